#include "abbe/methods/calibration_session.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>
#include <variant>

#include "abbe/result/try.hpp"

namespace abbe::daemon {

namespace {

using protocol::HostTime;

/// True if the acquisition guides the operator from touch to touch.
template <class Acquisition>
constexpr bool kGuided = requires(Acquisition& acquisition) {
  acquisition.next();
  acquisition.take_notes();
};

/// True if the method has tables while the machine moves.
template <class Acquisition>
constexpr bool kLive = requires(Acquisition& acquisition) {
  acquisition.take_news();
  acquisition.remaining();
};

std::optional<RequestedTouch> next_of(const Acquisition& acquisition) {
  return std::visit(
      [](const auto& of_method) -> std::optional<RequestedTouch> {
        if constexpr (kGuided<std::remove_cvref_t<decltype(of_method)>>) return of_method.next();
        return std::nullopt;
      },
      acquisition);
}

}  // namespace

bool CalibrationSession::running() const noexcept {
  return status_.state == SessionState::Warming || status_.state == SessionState::Acquiring ||
         status_.state == SessionState::Identifying || status_.state == SessionState::Judged;
}

bool CalibrationSession::acquiring() const noexcept {
  return takes_readings(status_.state);
}

Result<PreparedSession> CalibrationSession::prepare(CalibrationTask task) const {
  return Methods::visit(
      std::move(task), [this](auto method, auto&& request) -> Result<PreparedSession> {
        using Options = typename decltype(method)::Options;
        auto made = method.acquire(std::move(request), std::get<Options>(options_));
        ABBE_TRY(made);
        return PreparedSession{.method = method.kName, .acquisition = std::move(*made)};
      });
}

Result<void> CalibrationSession::start(PreparedSession&& prepared, HostTime from) {
  if (running()) {
    return fail(ErrorCode::Refused, fmt::format("calibrate {}: a session is already {}",
                                                prepared.method, name(status_.state)));
  }

  std::visit([from](auto& a) { a.begin(from); }, prepared.acquisition);
  acquisition_.emplace(std::move(prepared.acquisition));
  status_ = {};
  status_.id = ++started_;
  status_.method = prepared.method;
  status_.next = next_of(*acquisition_);
  enter(SessionState::Warming, std::visit([](const auto& a) { return a.reason(); }, *acquisition_),
        from);

  return {};
}

Result<void> CalibrationSession::start(CalibrationRequest request) {
  auto prepared = prepare(std::move(request.task));
  ABBE_TRY(prepared);
  return start(std::move(*prepared), request.from);
}

Result<void> CalibrationSession::cancel(std::string who, HostTime now) {
  if (!running()) return fail(ErrorCode::Refused, "cancel: no session is running");
  enter(SessionState::Refused, fmt::format("cancelled by {}", who), now);
  return {};
}

void CalibrationSession::take(const protocol::Snapshot& snapshot) {
  if (!acquiring()) return;
  std::visit([&](auto& a) { a.take(snapshot); }, *acquisition_);
  follow_acquisition(snapshot.head.time);
}

void CalibrationSession::tick(HostTime now) {
  if (!acquiring()) return;
  std::visit([&](auto& a) { a.tick(now); }, *acquisition_);
  follow_acquisition(now);
}

void CalibrationSession::follow_acquisition(HostTime now) {
  const auto [phase, reason] = std::visit(
      [this](auto& a) {
        status_.progress = a.progress();
        status_.points = a.points();
        if constexpr (kLive<decltype(a)>) status_.remaining = a.remaining();
        return std::pair{a.phase(), a.reason()};
      },
      *acquisition_);

  std::visit(
      [&](auto& acquisition) {
        if constexpr (kGuided<decltype(acquisition)>) follow_guidance(acquisition, now);
      },
      *acquisition_);

  switch (phase) {
    case AcquisitionPhase::WaitingAtStart:
      break;
    case AcquisitionPhase::Running:
      if (status_.state == SessionState::Warming) enter(SessionState::Acquiring, reason, now);
      break;
    case AcquisitionPhase::Complete:
      enter(SessionState::Identifying, reason, now);
      break;
    case AcquisitionPhase::Failed:
      enter(SessionState::Refused, reason, now);
      break;
  }
}

/// Adds the notes first and then the next instruction. Both are events, so that subscribers receive
/// them in this order.
template <class Guided>
void CalibrationSession::follow_guidance(Guided& acquisition, HostTime now) {
  const auto notes = acquisition.take_notes();
  for (const std::string& note : notes) {
    status_.notes.push_back(note);
    ++status_.noted;
    enter(status_.state, note, now);
  }

  if (status_.notes.size() > SessionStatus::kMostNotes) {
    const auto surplus = status_.notes.size() - SessionStatus::kMostNotes;
    status_.notes.erase(status_.notes.begin(),
                        status_.notes.begin() + static_cast<std::ptrdiff_t>(surplus));
  }

  status_.next = acquisition.next();
  const bool same_state = acquisition.phase() == (status_.state == SessionState::Warming
                                                      ? AcquisitionPhase::WaitingAtStart
                                                      : AcquisitionPhase::Running);
  if (same_state && acquisition.reason() != status_.reason)
    enter(status_.state, acquisition.reason(), now);
}

std::optional<RunNews> CalibrationSession::take_news() {
  if (status_.state != SessionState::Acquiring) return std::nullopt;
  return std::visit(
      [](auto& a) -> std::optional<RunNews> {
        if constexpr (kLive<decltype(a)>)
          if (a.has_live_tables()) return a.take_news();
        return std::nullopt;
      },
      *acquisition_);
}

std::optional<Acquisition> CalibrationSession::take_run() {
  if (status_.state != SessionState::Identifying || !acquisition_) return std::nullopt;
  status_.progress = 0.0;
  return std::exchange(acquisition_, std::nullopt);
}

CalibrationRun run_of(Acquisition acquired) {
  return Methods::visit(std::move(acquired), [](auto method, auto&& of_method) -> CalibrationRun {
    return method.run_of(std::move(of_method));
  });
}

void CalibrationSession::judged(std::string model_id, bool passed, std::string reason,
                                HostTime now) {
  if (status_.state != SessionState::Identifying) return;  // cancelled meanwhile
  status_.model_id = std::move(model_id);
  enter(SessionState::Judged, reason, now);
  status_.refused_as = ErrorCode::Refused;
  enter(passed ? SessionState::Active : SessionState::Refused, std::move(reason), now);
}

void CalibrationSession::not_identified(const Error& why, HostTime now) {
  if (status_.state != SessionState::Identifying) return;
  status_.refused_as = why.code;
  enter(SessionState::Refused, why.text, now);
}

void CalibrationSession::not_stored(std::string reason, HostTime now) {
  if (status_.state != SessionState::Identifying || reason == status_.reason) return;
  enter(SessionState::Identifying, std::move(reason), now);
}

std::vector<SessionEvent> CalibrationSession::take_events() {
  return std::exchange(events_, {});
}

void CalibrationSession::enter(SessionState state, std::string reason, HostTime now) {
  status_.state = state;
  status_.reason = std::move(reason);
  if (state != SessionState::Acquiring) status_.remaining.reset();
  if (state == SessionState::Active || state == SessionState::Refused) {
    status_.progress = 1.0;
    status_.next.reset();
    if (acquisition_) discarded_ = std::exchange(acquisition_, std::nullopt);
  }
  events_.push_back({now, status_});
}

}  // namespace abbe::daemon

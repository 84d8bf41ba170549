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

/// True if the method has tables that can be shown while the machine moves.
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

Result<PreparedSession> CalibrationSession::prepare(CalibrationTask task) const {
  return Methods::visit(
      std::move(task), [this](auto method, auto&& request) -> Result<PreparedSession> {
        using Options = typename decltype(method)::Options;
        auto made = method.acquire(std::move(request), std::get<Options>(options_));
        ABBE_TRY(made);
        return PreparedSession{.method = method.kName, .acquisition = std::move(*made)};
      });
}

Result<void> CalibrationSession::start(PreparedSession&& prepared, std::string who, HostTime from) {
  if (stage_ == SessionStage::Ending) {
    return fail(ErrorCode::Refused,
                fmt::format("calibrate {}: the identification of a cancelled run is still ending",
                            prepared.method));
  }
  if (running()) {
    return fail(ErrorCode::Refused, fmt::format("calibrate {}: a session is already {}",
                                                prepared.method, name(status_.state)));
  }

  std::visit([from](auto& a) { a.begin(from); }, prepared.acquisition);
  acquisition_.emplace(std::move(prepared.acquisition));
  if (status_.id != 0) ended_.push_back(std::move(status_));
  if (ended_.size() > kEndedKept) ended_.pop_front();
  status_ = {};
  status_.id = ++started_;
  status_.method = prepared.method;
  status_.next = next_of(*acquisition_);
  who_ = std::move(who);
  std::swap(request_text_, prepared.request_text);  // the caller destroys the previous text
  enter(SessionStep::Start, std::visit([](const auto& a) { return a.reason(); }, *acquisition_),
        from);

  return {};
}

Result<void> CalibrationSession::start(CalibrationRequest request) {
  auto prepared = prepare(std::move(request.task));
  ABBE_TRY(prepared);
  return start(std::move(*prepared), {}, request.from);
}

Result<void> CalibrationSession::cancel(std::string who, HostTime now) {
  if (enter(SessionStep::Cancel, fmt::format("cancelled by {}", who), now)) return {};
  return fail(ErrorCode::Refused, stage_ == SessionStage::Storing
                                      ? "cancel: the model is already being stored"
                                      : "cancel: no session is running");
}

Result<void> CalibrationSession::give_up_store(std::string who, HostTime now) {
  if (enter(SessionStep::GiveUpStore, fmt::format("cancelled by {}", who), now)) return {};
  return cancel(std::move(who), now);
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
        if constexpr (kLive<decltype(a)>) {
          status_.remaining = a.remaining();
          if (const StartCheck* check = a.start()) status_.start = check->state();
        }
        return std::pair{a.phase(), a.reason()};
      },
      *acquisition_);

  std::visit(
      [&](auto& acquisition) {
        if constexpr (kGuided<decltype(acquisition)>) follow_guidance(acquisition, now);
      },
      *acquisition_);

  const bool same_state =
      phase == (stage_ == SessionStage::Warming ? AcquisitionPhase::WaitingAtStart
                                                : AcquisitionPhase::Running);
  if (same_state && reason != status_.reason) add_event(reason, now);

  switch (phase) {
    case AcquisitionPhase::WaitingAtStart:
      break;
    case AcquisitionPhase::Running:
      if (stage_ == SessionStage::Warming) enter(SessionStep::RunBegins, reason, now);
      break;
    case AcquisitionPhase::Complete:
      enter(SessionStep::RunCompletes, reason, now);
      break;
    case AcquisitionPhase::Failed:
      enter(SessionStep::RunFails, reason, now);
      break;
  }
}

/// Adds the notes; the caller adds the next instruction. Both are events, so that subscribers
/// receive them in this order.
template <class Guided>
void CalibrationSession::follow_guidance(Guided& acquisition, HostTime now) {
  const auto notes = acquisition.take_notes();
  for (const std::string& note : notes) {
    status_.notes.push_back(note);
    ++status_.noted;
    add_event(note, now);
  }

  if (status_.notes.size() > SessionStatus::kMostNotes) {
    const auto surplus = status_.notes.size() - SessionStatus::kMostNotes;
    status_.notes.erase(status_.notes.begin(),
                        status_.notes.begin() + static_cast<std::ptrdiff_t>(surplus));
  }

  status_.next = acquisition.next();
}

std::optional<RunNews> CalibrationSession::take_news() {
  if (stage_ != SessionStage::Acquiring) return std::nullopt;
  return std::visit(
      [](auto& a) -> std::optional<RunNews> {
        if constexpr (kLive<decltype(a)>)
          if (a.has_live_tables()) return a.take_news();
        return std::nullopt;
      },
      *acquisition_);
}

std::optional<Acquisition> CalibrationSession::take_run() {
  if (!go(SessionStep::RunTaken, since_)) return std::nullopt;
  status_.progress = 0.0;
  return std::exchange(acquisition_, std::nullopt);
}

CalibrationRun run_of(Acquisition acquired) {
  return Methods::visit(std::move(acquired), [](auto method, auto&& of_method) -> CalibrationRun {
    return method.run_of(std::move(of_method));
  });
}

void CalibrationSession::not_identified(const Error& why, HostTime now) {
  if (stage_ == SessionStage::Ending) {  // the session was cancelled meanwhile and is refused
                                         // already
    (void)go(SessionStep::NoModel, now);
    return;
  }
  if (stage_ != SessionStage::Identifying) return;
  status_.refused_as = why.code;
  enter(SessionStep::NoModel, why.text, now);
}

void CalibrationSession::identified(const calib::HeldOutFigures& held_out, HostTime now) {
  if (go(SessionStep::ModelIdentified, now)) held_out_ = held_out;
}

void CalibrationSession::store_failed(std::string fault, std::string_view advice, HostTime now) {
  if (go(SessionStep::StoreFails, now)) report_not_stored(std::move(fault), advice, now);
}

void CalibrationSession::store_stalls(std::string fault, std::string_view advice, HostTime now) {
  if (stage_ == SessionStage::Storing) report_not_stored(std::move(fault), advice, now);
}

void CalibrationSession::report_not_stored(std::string fault, std::string_view advice,
                                           HostTime now) {
  std::string reason = fmt::format("{}; {}", fault, advice);
  not_stored_ = std::move(fault);
  if (reason != status_.reason) add_event(std::move(reason), now);
}

void CalibrationSession::judged(std::string model_id, bool passed, std::string reason,
                                SessionVerdict verdict, HostTime now) {
  if (!next_stage(stage_, SessionStep::ModelStored)) return;
  status_.model_id = std::move(model_id);
  status_.verdict = std::move(verdict);
  enter(SessionStep::ModelStored, reason, now);
  status_.refused_as = ErrorCode::Refused;
  enter(passed ? SessionStep::VerdictPasses : SessionStep::VerdictFails, std::move(reason), now);
}

std::vector<SessionEvent> CalibrationSession::take_events() {
  return std::exchange(events_, {});
}

/// The only function that changes the stage. False if the step is not possible in this stage.
bool CalibrationSession::go(SessionStep step, HostTime now) {
  const auto next = next_stage(stage_, step);
  if (!next) return false;
  stage_ = *next;
  since_ = now;
  status_.state = state_of(stage_);
  return true;
}

/// Makes a step that is also an event.
bool CalibrationSession::enter(SessionStep step, std::string reason, HostTime now) {
  if (!go(step, now)) return false;
  if (stage_ != SessionStage::Acquiring) status_.remaining.reset();
  if (stage_ != SessionStage::Warming) status_.start.reset();
  if (has_ended(stage_)) {
    status_.progress = 1.0;
    status_.next.reset();
    not_stored_.clear();
    if (acquisition_) discarded_ = std::exchange(acquisition_, std::nullopt);
  }
  add_event(std::move(reason), now);
  return true;
}

/// Adds an event with a new reason.
void CalibrationSession::add_event(std::string reason, HostTime now) {
  status_.reason = std::move(reason);
  events_.push_back({now, status_});
}

}  // namespace abbe::daemon

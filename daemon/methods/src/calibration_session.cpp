#include "abbe/methods/calibration_session.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>
#include <variant>

namespace abbe::daemon {

using protocol::HostTime;

bool CalibrationSession::running() const noexcept {
  return status_.state == SessionState::Warming || status_.state == SessionState::Acquiring ||
         status_.state == SessionState::Identifying || status_.state == SessionState::Judged;
}

bool CalibrationSession::acquiring() const noexcept {
  return takes_readings(status_.state);
}

Result<PreparedSession> CalibrationSession::prepare(CalibrationTask task) const {
  const std::string_view method = method_of(task);
  if (auto* touching = std::get_if<EvemuRequest>(&task)) {
    auto made = EvemuAcquisition::create(std::move(*touching), evemu_options_);
    if (!made) return tl::unexpected(made.error());
    return PreparedSession{.method = method, .path_m = {}, .acquisition = std::move(*made)};
  }
  auto& path_m = std::get<OtfRequest>(task).path_m;
  if (path_m.size() < 2)
    return fail(ErrorCode::BadInput, "calibrate otf: a path needs at least two vertices");
  OtfAcquisition made{path_m, otf_options_};
  return PreparedSession{
      .method = method, .path_m = std::move(path_m), .acquisition = std::move(made)};
}

Result<void> CalibrationSession::start(PreparedSession&& prepared, HostTime from) {
  if (running()) {
    return fail(ErrorCode::Refused, fmt::format("calibrate {}: a session is {} already",
                                                prepared.method, name(status_.state)));
  }

  std::visit([from](auto& a) { a.begin(from); }, prepared.acquisition);
  acquisition_.emplace(std::move(prepared.acquisition));
  std::swap(path_m_, prepared.path_m);
  status_ = {};
  status_.id = ++started_;
  status_.method = prepared.method;
  if (const auto* touching = std::get_if<EvemuAcquisition>(&*acquisition_))
    status_.next = touching->next();
  enter(SessionState::Warming, std::visit([](const auto& a) { return a.reason(); }, *acquisition_),
        from);

  return {};
}

Result<void> CalibrationSession::start(CalibrationRequest request) {
  auto prepared = prepare(std::move(request.task));
  if (!prepared) return tl::unexpected(prepared.error());
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
      [this](const auto& a) {
        status_.progress = a.progress();
        status_.points = a.points();
        return std::pair{a.phase(), a.reason()};
      },
      *acquisition_);
  if (auto* touching = std::get_if<EvemuAcquisition>(&*acquisition_))
    follow_guidance(*touching, now);

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

/// A note is said, then what to do; both are events, so that whoever listens hears them in this
/// order.
void CalibrationSession::follow_guidance(EvemuAcquisition& touching, HostTime now) {
  const auto notes = touching.take_notes();
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

  status_.next = touching.next();
  const bool same_state =
      touching.phase() == (status_.state == SessionState::Warming ? AcquisitionPhase::WaitingAtStart
                                                                  : AcquisitionPhase::Running);
  if (same_state && touching.reason() != status_.reason)
    enter(status_.state, touching.reason(), now);
}

std::optional<AcquiredRun> CalibrationSession::take_run() {
  if (status_.state != SessionState::Identifying || !acquisition_) return std::nullopt;
  AcquiredRun acquired{.path_m = std::exchange(path_m_, {}),
                       .acquisition = std::move(*acquisition_),
                       .environment = otf_options_.environment};
  acquisition_.reset();
  status_.progress = 0.0;
  return acquired;
}

CalibrationRun run_of(AcquiredRun acquired) {
  if (auto* touching = std::get_if<EvemuAcquisition>(&acquired.acquisition))
    return touching->release();
  auto& otf = std::get<OtfAcquisition>(acquired.acquisition);
  const EnvironmentEffect effect = otf.environment();
  for (AxisPosition& q_m : acquired.path_m) q_m = at_temperature(q_m, effect, acquired.environment);
  return OtfRun{.path_m = std::move(acquired.path_m),
                .points = otf.release(),
                .u_scale = effect.u_scale,
                .u_axis_scale = effect.u_expansion_factor,
                .unmeasured_air = acquired.environment.unmeasured_air};
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
  if (state == SessionState::Active || state == SessionState::Refused) {
    status_.progress = 1.0;
    status_.next.reset();
    if (acquisition_) discarded_ = std::exchange(acquisition_, std::nullopt);
  }
  events_.push_back({now, status_});
}

}  // namespace abbe::daemon

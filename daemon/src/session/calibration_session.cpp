#include "abbe/daemon/calibration_session.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>
#include <variant>

namespace abbe::daemon {

using protocol::HostTime;

std::string_view name(SessionState state) noexcept {
  static constexpr std::array<std::string_view, 7> kNames{"idle",   "warming", "acquiring", "identifying",
                                                          "judged", "active",  "refused"};
  return kNames[static_cast<std::size_t>(state)];
}

bool CalibrationSession::running() const noexcept {
  return status_.state == SessionState::Warming || status_.state == SessionState::Acquiring ||
         status_.state == SessionState::Identifying || status_.state == SessionState::Judged;
}

bool CalibrationSession::acquiring() const noexcept {
  return status_.state == SessionState::Warming || status_.state == SessionState::Acquiring;
}

Result<CalibrationSession::Acquisition> CalibrationSession::acquisition(
    const CalibrationRequest& request) const {
  if (const auto* touching = std::get_if<EvemuRequest>(&request.task)) {
    auto made = EvemuAcquisition::create(*touching, request.from, evemu_options_);
    if (!made) return tl::unexpected(made.error());
    return std::move(*made);
  }
  const auto& path_m = std::get<OtfRequest>(request.task).path_m;
  if (path_m.size() < 2)
    return fail(ErrorCode::BadInput, "calibrate otf: a path needs at least two vertices");
  return OtfAcquisition{path_m, request.from, otf_options_};
}

Result<void> CalibrationSession::start(CalibrationRequest request) {
  if (running()) {
    return fail(ErrorCode::Refused, fmt::format("calibrate {}: a session is {} already",
                                                method_of(request.task), name(status_.state)));
  }
  auto made = acquisition(request);
  if (!made) return tl::unexpected(made.error());
  acquisition_.emplace(std::move(*made));
  status_ = {};
  status_.method = method_of(request.task);
  if (auto* otf = std::get_if<OtfRequest>(&request.task)) path_m_ = std::move(otf->path_m);
  if (const auto* touching = std::get_if<EvemuAcquisition>(&*acquisition_)) status_.next = touching->next();
  enter(SessionState::Warming, std::visit([](const auto& a) { return a.reason(); }, *acquisition_),
        request.from);
  return {};
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

namespace {

std::size_t points_of(const OtfAcquisition& a) {
  return a.points().size();
}
std::size_t points_of(const EvemuAcquisition& a) {
  return a.points();
}

}  // namespace

void CalibrationSession::follow_acquisition(HostTime now) {
  const auto [phase, reason] = std::visit(
      [this](const auto& a) {
        status_.progress = a.progress();
        status_.points = points_of(a);
        return std::pair{a.phase(), a.reason()};
      },
      *acquisition_);
  if (auto* touching = std::get_if<EvemuAcquisition>(&*acquisition_)) follow_guidance(*touching, now);
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

/// A note is said, then what to do; both are events, so that whoever listens hears them in this order.
void CalibrationSession::follow_guidance(EvemuAcquisition& touching, HostTime now) {
  const auto notes = touching.take_notes();
  for (const std::string& note : notes) {
    status_.notes.push_back(note);
    ++status_.noted;
    enter(status_.state, note, now);
  }
  if (status_.notes.size() > SessionStatus::kMostNotes) {
    const auto surplus = status_.notes.size() - SessionStatus::kMostNotes;
    status_.notes.erase(status_.notes.begin(), status_.notes.begin() + static_cast<std::ptrdiff_t>(surplus));
  }
  status_.next = touching.next();
  const bool same_state =
      touching.phase() ==
      (status_.state == SessionState::Warming ? AcquisitionPhase::WaitingAtStart : AcquisitionPhase::Running);
  if (same_state && touching.reason() != status_.reason) enter(status_.state, touching.reason(), now);
}

std::optional<CalibrationRun> CalibrationSession::take_run() {
  if (status_.state != SessionState::Identifying || !acquisition_) return std::nullopt;
  CalibrationRun run;
  if (auto* otf = std::get_if<OtfAcquisition>(&*acquisition_)) {
    const EnvironmentEffect effect = otf->environment();
    std::vector<AxisPosition> path_m = path_m_;
    for (AxisPosition& q_m : path_m) q_m = grown(q_m, effect, otf_options_.environment);
    run = OtfRun{.path_m = std::move(path_m), .points = otf->release(), .u_scale = effect.u_scale};
  } else {
    run = std::get<EvemuAcquisition>(*acquisition_).release();
  }
  acquisition_.reset();
  status_.progress = 0.0;
  return run;
}

void CalibrationSession::judged(std::string model_id, bool passed, std::string reason, HostTime now) {
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

std::vector<SessionEvent> CalibrationSession::take_events() {
  return std::exchange(events_, {});
}

void CalibrationSession::enter(SessionState state, std::string reason, HostTime now) {
  status_.state = state;
  status_.reason = std::move(reason);
  if (state == SessionState::Active || state == SessionState::Refused) {
    status_.progress = 1.0;
    status_.next.reset();
    acquisition_.reset();
  }
  events_.push_back({now, status_});
}

}  // namespace abbe::daemon

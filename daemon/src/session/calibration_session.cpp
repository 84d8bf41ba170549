#include "abbe/daemon/calibration_session.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

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

Result<void> CalibrationSession::start(std::vector<AxisPosition> path_m, HostTime from) {
  if (running()) {
    return fail(ErrorCode::Refused,
                fmt::format("calibrate otf: a session is {} already", name(status_.state)));
  }
  if (path_m.size() < 2)
    return fail(ErrorCode::BadInput, "calibrate otf: a path needs at least two vertices");
  path_m_ = std::move(path_m);
  acquisition_.emplace(path_m_, from, acquisition_options_);
  status_ = {};
  enter(SessionState::Warming, acquisition_->reason(), from);
  return {};
}

Result<void> CalibrationSession::cancel(std::string who, HostTime now) {
  if (!running()) return fail(ErrorCode::Refused, "cancel: no session is running");
  enter(SessionState::Refused, fmt::format("cancelled by {}", who), now);
  return {};
}

void CalibrationSession::take(const protocol::Snapshot& snapshot) {
  if (status_.state != SessionState::Warming && status_.state != SessionState::Acquiring) return;
  acquisition_->take(snapshot);
  follow_acquisition(snapshot.head.time);
}

void CalibrationSession::tick(HostTime now) {
  if (status_.state != SessionState::Warming && status_.state != SessionState::Acquiring) return;
  acquisition_->tick(now);
  follow_acquisition(now);
}

void CalibrationSession::follow_acquisition(HostTime now) {
  status_.progress = acquisition_->progress();
  status_.points = acquisition_->points().size();
  switch (acquisition_->phase()) {
    case OtfAcquisition::Phase::WaitingAtStart:
      break;
    case OtfAcquisition::Phase::Running:
      if (status_.state == SessionState::Warming) enter(SessionState::Acquiring, acquisition_->reason(), now);
      break;
    case OtfAcquisition::Phase::Complete:
      enter(SessionState::Identifying, acquisition_->reason(), now);
      break;
    case OtfAcquisition::Phase::Failed:
      enter(SessionState::Refused, acquisition_->reason(), now);
      break;
  }
}

std::optional<std::vector<RunPoint>> CalibrationSession::take_run() {
  if (status_.state != SessionState::Identifying || !acquisition_) return std::nullopt;
  auto run = acquisition_->release();
  acquisition_.reset();
  status_.progress = 0.0;
  return run;
}

void CalibrationSession::judged(std::string model_id, bool passed, std::string reason, HostTime now) {
  if (status_.state != SessionState::Identifying) return;  // cancelled meanwhile
  status_.model_id = std::move(model_id);
  enter(SessionState::Judged, reason, now);
  enter(passed ? SessionState::Active : SessionState::Refused, std::move(reason), now);
}

void CalibrationSession::not_identified(std::string reason, HostTime now) {
  if (status_.state == SessionState::Identifying) enter(SessionState::Refused, std::move(reason), now);
}

std::vector<SessionEvent> CalibrationSession::take_events() {
  return std::exchange(events_, {});
}

void CalibrationSession::enter(SessionState state, std::string reason, HostTime now) {
  status_.state = state;
  status_.reason = std::move(reason);
  if (state == SessionState::Active || state == SessionState::Refused) {
    status_.progress = 1.0;
    acquisition_.reset();
  }
  events_.push_back({now, status_});
}

}  // namespace abbe::daemon

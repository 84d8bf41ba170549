/// The measurement of a tracker session: points, silence, the beam.

#include <fmt/format.h>

#include <algorithm>

#include "abbe/drivers/tracker/session.hpp"
#include "refusals.hpp"

namespace abbe::drivers {
namespace {

/// Points of before a break may still arrive one burst (at most a third of a second) after its
/// report.
constexpr std::chrono::milliseconds kLastBurst{500};

std::string no_beam(const std::string& why) {
  return why + ": bring the reflector to the beam";
}

}  // namespace

/// Continuous distance has no period: a machine that stands still sends nothing, and only the
/// controller can be asked.
std::chrono::nanoseconds TrackerSession::silence_allowed() const noexcept {
  switch (options_.mode) {
    case TrackerMode::ContinuousTime:
      return std::max<std::chrono::nanoseconds>(
          options_.silence_timeout, 3 * std::chrono::milliseconds{options_.time_separation_ms});
    case TrackerMode::Stationary:
      return options_.silence_timeout + 3 * std::chrono::milliseconds{options_.stationary_time_ms};
    case TrackerMode::ContinuousDistance:
      break;
  }
  return options_.keep_alive;
}

void TrackerSession::streaming() {
  state_ = TrackerState::Streaming;
  cause_.clear();
  restart_at_.reset();
  result_came_ = false;
  due_ = now_ + silence_allowed();
}

TrackerAction TrackerSession::tick_streaming() {
  if (options_.mode == TrackerMode::ContinuousDistance) return ask_alive();
  const double allowed_s = std::chrono::duration<double>(silence_allowed()).count();
  return give_up(TrackerState::Faulted, fmt::format("no points in {:g} s", allowed_s));
}

TrackerAction TrackerSession::ask_alive() {
  due_ = now_ + options_.keep_alive;
  if (pending_) return TrackerNothing{};
  return send({state_, emscon::GetTrackerStatus{}, true}, false);
}

TrackerAction TrackerSession::start_again() {
  restart_at_.reset();
  if (!online() || stopped_) return TrackerNothing{};
  return send({state_, emscon::StartMeasurement{}, false}, false);
}

TrackerAction TrackerSession::take(const TrackerPointsArrived&) {
  if (without_beam()) {
    if (!restart_at_ && now_ - beam_lost_at_ < kLastBurst) return TrackerNothing{};
    streaming();
  }
  if (state_ != TrackerState::Streaming) return TrackerNothing{};
  pause_ = options_.first_pause;
  due_ = now_ + silence_allowed();
  result_came_ = options_.mode == TrackerMode::Stationary;
  return result_came_ && !pending_ && !order_ ? measure_again() : TrackerAction{TrackerNothing{}};
}

/// Stationary: one result for one StartMeasurement.
TrackerAction TrackerSession::measure_again() {
  state_ = TrackerState::Ready;
  due_ = kNever;
  return send({TrackerState::Ready, emscon::StartMeasurement{}, false}, false);
}

TrackerAction TrackerSession::beam_lost(const std::string& why) {
  if (state_ != TrackerState::Streaming && state_ != TrackerState::BeamLost)
    return TrackerNothing{};
  state_ = TrackerState::BeamLost;
  cause_ = no_beam(why);
  beam_lost_at_ = now_;
  restart_at_.reset();
  due_ = now_ + options_.keep_alive;
  return TrackerNothing{};
}

/// StartMeasurement was refused for want of a beam: the controller reports when it is there, and is
/// asked in case the report is missed. Nothing is sent meanwhile that could disturb who brings the
/// reflector.
TrackerAction TrackerSession::wait_for_beam(const std::string& why) {
  pending_.reset();
  if (!without_beam()) {
    state_ = TrackerState::WaitBeam;
    beam_lost_at_ = now_;
  }
  cause_ = no_beam(why);
  restart_at_.reset();
  due_ = now_ + options_.keep_alive;
  return TrackerNothing{};
}

/// After a lost beam StartMeasurement may be refused. If because the old measurement still runs,
/// stopping it is what helps; if not, it does no harm. If points came meanwhile, the old
/// measurement runs and all is well.
TrackerAction TrackerSession::start_refused() {
  const TrackerState state = state_;
  pending_.reset();
  return send({state, emscon::StopMeasurement{}, true}, false);
}

TrackerAction TrackerSession::done_without_beam(const emscon::Answer& answer) {
  const emscon::Command command = emscon::command_of(answer);
  if (command == emscon::Command::StartMeasurement) streaming();
  if (command == emscon::Command::StopMeasurement) return ask_alive();
  const auto* tracker = std::get_if<emscon::TrackerStatusAnswer>(&answer);
  if (tracker != nullptr && tracker->tracker == emscon::TrackerStatus::Ready && !restart_at_) {
    restart_at_ = now_ + options_.resume_within;  // the event that says so was missed
  }
  return TrackerNothing{};
}

}  // namespace abbe::drivers

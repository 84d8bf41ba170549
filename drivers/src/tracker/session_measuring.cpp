/// The measurement of a tracker session: points, missing points, loss of the beam.

#include <fmt/format.h>

#include <algorithm>

#include "abbe/drivers/tracker/session.hpp"
#include "refusals.hpp"

namespace abbe::drivers {
namespace {

/// Points measured before a beam loss may arrive up to one burst (at most 1/3 s) after its report.
constexpr std::chrono::milliseconds kLastBurst{500};

std::string no_beam(const std::string& why) {
  return why + ": bring the reflector to the beam";
}

}  // namespace

/// Longest time without points that is no fault. In mode ContinuousDistance the points have no
/// fixed interval: none come while the machine stands still, and only a status query shows that the
/// controller still answers.
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
  deadlines_.cancel(Due::Restart);
  result_came_ = false;
  in_state(Due::Points, silence_allowed());
}

TrackerAction TrackerSession::tick_streaming() {
  if (options_.mode == TrackerMode::ContinuousDistance) return query_status();
  const double allowed_s = std::chrono::duration<double>(silence_allowed()).count();
  return give_up(TrackerState::Faulted, fmt::format("no points in {:g} s", allowed_s));
}

TrackerAction TrackerSession::query_status() {
  in_state(without_beam() ? Due::Query : Due::Points, options_.keep_alive);
  if (pending_) return TrackerNothing{};
  return send({state_, emscon::GetTrackerStatus{}, true}, false);
}

void TrackerSession::restart_when_beam_is_back() {
  if (!deadlines_.is_set(Due::Restart)) deadlines_.set(Due::Restart, now_ + options_.resume_within);
}

TrackerAction TrackerSession::start_again() {
  deadlines_.cancel(Due::Restart);
  if (!online() || stopped_) return TrackerNothing{};
  return send({state_, emscon::StartMeasurement{}, false}, false);
}

TrackerAction TrackerSession::take(const TrackerPointsArrived&) {
  if (without_beam()) {
    if (!deadlines_.is_set(Due::Restart) && now_ - beam_lost_at_ < kLastBurst)
      return TrackerNothing{};
    streaming();
  }
  if (state_ != TrackerState::Streaming) return TrackerNothing{};
  pause_ = options_.first_pause;
  in_state(Due::Points, silence_allowed());
  result_came_ = options_.mode == TrackerMode::Stationary;
  return result_came_ && !pending_ && !order_ ? measure_again() : TrackerAction{TrackerNothing{}};
}

/// Starts the next measurement of mode Stationary: each StartMeasurement gives one result.
TrackerAction TrackerSession::measure_again() {
  state_ = TrackerState::Ready;
  without_deadline_of_state();
  return send({TrackerState::Ready, emscon::StartMeasurement{}, false}, false);
}

TrackerAction TrackerSession::beam_lost(const std::string& why) {
  if (state_ != TrackerState::Streaming && state_ != TrackerState::BeamLost)
    return TrackerNothing{};
  state_ = TrackerState::BeamLost;
  cause_ = no_beam(why);
  beam_lost_at_ = now_;
  deadlines_.cancel(Due::Restart);
  in_state(Due::Query, options_.keep_alive);
  return TrackerNothing{};
}

/// StartMeasurement was refused because there is no beam. The controller reports when the beam is
/// back; in case that report is missed, the session also queries the status. Meanwhile no command
/// is sent that could disturb the operator with the reflector.
TrackerAction TrackerSession::wait_for_beam(const std::string& why) {
  end_pending();
  if (!without_beam()) {
    state_ = TrackerState::WaitBeam;
    beam_lost_at_ = now_;
  }
  cause_ = no_beam(why);
  deadlines_.cancel(Due::Restart);
  in_state(Due::Query, options_.keep_alive);
  return TrackerNothing{};
}

/// StartMeasurement may be refused after a beam loss because the previous measurement is still
/// running. Then StopMeasurement is necessary; in every other case it has no effect. If points
/// arrive meanwhile, the previous measurement is running and the session streams.
TrackerAction TrackerSession::start_refused() {
  const TrackerState state = state_;
  end_pending();
  return send({state, emscon::StopMeasurement{}, true}, false);
}

TrackerAction TrackerSession::done_without_beam(const emscon::Answer& answer) {
  const emscon::Command command = emscon::command_of(answer);
  if (command == emscon::Command::StartMeasurement) streaming();
  if (command == emscon::Command::StopMeasurement) return query_status();
  const auto* tracker = std::get_if<emscon::TrackerStatusAnswer>(&answer);
  if (tracker != nullptr && tracker->tracker == emscon::TrackerStatus::Ready)
    restart_when_beam_is_back();  // the event of the controller was missed
  return TrackerNothing{};
}

}  // namespace abbe::drivers

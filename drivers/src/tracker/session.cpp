#include "abbe/drivers/tracker/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "refusals.hpp"

namespace abbe::drivers {

using emscon::Event;
using emscon::Status;

const char* name_of(TrackerState state) noexcept {
  switch (state) {
    case TrackerState::Disconnected:
      return "disconnected";
    case TrackerState::Connecting:
      return "connecting";
    case TrackerState::Querying:
      return "querying";
    case TrackerState::WaitWarm:
      return "warming up";
    case TrackerState::Configuring:
      return "configuring";
    case TrackerState::Initialising:
      return "initialising";
    case TrackerState::Ready:
      return "ready";
    case TrackerState::Streaming:
      return "streaming";
    case TrackerState::BeamLost:
      return "beam lost";
    case TrackerState::WaitBeam:
      return "waiting for the beam";
    case TrackerState::Moving:
      return "moving the beam";
    case TrackerState::Restoring:
      return "restoring settings";
    case TrackerState::Stopping:
      return "stopping";
    case TrackerState::Faulted:
      return "faulted";
  }

  return "unknown";
}

std::string describe(const TrackerProtocolError& malformed) {
  std::string hex;
  std::string text;
  for (std::size_t i = 0; i < malformed.length; ++i) {
    const auto value = static_cast<unsigned char>(malformed.first_bytes[i]);
    hex += fmt::format("{}{:02x}", i == 0 ? "" : " ", value);
    text += value >= 0x20 && value < 0x7f ? static_cast<char>(value) : '.';
  }
  return fmt::format("expected emScon answer, got {} \"{}\" ({})", hex, text,
                     malformed.error ? emscon::name_of(*malformed.error) : "invalid packet size");
}

Result<void> check(const TrackerSessionOptions& o) {
  const auto bad = [&](const char* what) -> Result<void> {
    return tl::unexpected{Error{ErrorCode::BadConfiguration, fmt::format("{}: {}", o.peer, what)}};
  };

  if (o.time_separation_ms < 1 || o.time_separation_ms > 60'000)
    return bad("time separation is not in 1 to 60000 ms");
  if (!(o.spatial_distance_mm > 0.0)) return bad("spatial distance must be above 0 mm");
  if (o.stationary_time_ms < 1 || o.stationary_time_ms > 60'000)
    return bad("stationary time is not in 1 to 60000 ms");
  if (o.packets_per_second < 3 || o.packets_per_second > 10)
    return bad("packet rate is not in 3 to 10 per second");
  if (o.search && (!(o.search->radius > 0.0) || o.search->timeout_ms < 1))
    return bad("search radius and time-out must be above 0");
  if (o.first_pause <= std::chrono::nanoseconds{0} || o.longest_pause < o.first_pause)
    return bad("first pause must be above 0 and not above the longest pause");

  return {};
}

TrackerSession::TrackerSession(TrackerSessionOptions options)
    : options_(std::move(options)), settings_(options_), pause_(options_.first_pause) {
  deadlines_.set(Due::Connect, {});
}

bool TrackerSession::online() const noexcept {
  return state_ != TrackerState::Disconnected && state_ != TrackerState::Faulted &&
         state_ != TrackerState::Connecting;
}

void TrackerSession::without_deadline_of_state() {
  for (const Due due : kOfState) deadlines_.cancel(due);
}

void TrackerSession::in_state(Due due, std::chrono::nanoseconds within) {
  without_deadline_of_state();
  deadlines_.set(due, now_ + within);
}

/// Connects again after `pause`, unless the session was stopped.
void TrackerSession::connect_after(std::chrono::nanoseconds pause) {
  stopped_ ? without_deadline_of_state() : in_state(Due::Connect, pause);
}

TrackerAction TrackerSession::on(const TrackerInput& input, protocol::HostTime now) {
  now_ = now;
  return std::visit([this](const auto& i) { return take(i); }, input);
}

TrackerAction TrackerSession::take(const TrackerTick&) {
  const auto due = deadlines_.passed(now_, waiting());
  if (!due) return TrackerNothing{};

  switch (*due) {
    case Due::Answer:
      return overdue();
    case Due::Repeat:
      return repeat();
    case Due::Order:
      return begin_order();
    case Due::Restart:
      return start_again();
    case Due::Connect:
      return connect();
    case Due::Connection:
      return give_up(TrackerState::Disconnected,
                     fmt::format("no connection in {:g} s",
                                 std::chrono::duration<double>(options_.connect_timeout).count()));
    case Due::WarmUp:
      return begin();
    case Due::Points:
      return tick_streaming();
    case Due::Query:
      return query_status();
    case Due::Leave:
      return plan_done();
  }

  return TrackerNothing{};
}

TrackerAction TrackerSession::connect() {
  state_ = TrackerState::Connecting;
  in_state(Due::Connection, options_.connect_timeout);
  return TrackerOpen{};
}

TrackerAction TrackerSession::take(const TrackerConnected&) {
  if (state_ != TrackerState::Connecting) return TrackerNothing{};
  return begin();
}

TrackerAction TrackerSession::take(const TrackerConnectionLost& lost) {
  if (state_ == TrackerState::Stopping) {
    end_pending();
    without_deadline_of_state();
    state_ = TrackerState::Disconnected;
    return TrackerNothing{};
  }
  if (state_ != TrackerState::Connecting && !online()) return TrackerNothing{};
  give_up(TrackerState::Disconnected, lost.what);
  return TrackerNothing{};  // the connection is already closed
}

TrackerAction TrackerSession::take(const TrackerProtocolError& malformed) {
  if (!online()) return TrackerNothing{};
  return give_up(TrackerState::Faulted, describe(malformed));
}

TrackerAction TrackerSession::take(const TrackerStopRequested&) {
  if (std::exchange(stopped_, true)) return TrackerNothing{};
  end_order(Outcome::Failed, "abbed is stopping");
  const bool connected = online() || state_ == TrackerState::Connecting;
  const bool measuring = state_ == TrackerState::Streaming || state_ == TrackerState::BeamLost;
  const bool may_have_set =
      online() && state_ != TrackerState::Querying && state_ != TrackerState::WaitWarm;
  new_plan(Goal::Leave);
  if (measuring) plan(TrackerState::Stopping, emscon::StopMeasurement{}, true);
  if (may_have_set) plan_restoring(TrackerState::Stopping);

  if (plan_.empty() || !connected) {
    end_pending();
    without_deadline_of_state();
    state_ = TrackerState::Disconnected;
    return connected ? TrackerAction{TrackerClose{}} : TrackerAction{TrackerNothing{}};
  }

  state_ = TrackerState::Stopping;
  in_state(Due::Leave, options_.leave_within);
  if (!pending_ || pending_->waiting_to_resend) return next_step();

  // One command at a time: the answer to the pending one must arrive first.
  pending_->step.optional = pending_->scripted = true;
  return TrackerNothing{};
}

void TrackerSession::note_fault(const std::string& what) {
  cause_ = what;
  fault_.text = fmt::format("{}: {}", options_.peer, what);
  ++fault_.count;
}

TrackerAction TrackerSession::give_up(TrackerState into, const std::string& what) {
  note_fault(what);
  end_order(Outcome::Failed, what);
  end_pending();
  deadlines_.cancel(Due::Restart);
  plan_.clear();
  state_ = into;
  connect_after(pause_);
  pause_ = std::min(2 * pause_, options_.longest_pause);
  return TrackerClose{};
}

TrackerAction TrackerSession::take(const emscon::ErrorResponse& error) {
  if (state_ == TrackerState::Streaming || state_ == TrackerState::BeamLost) {
    return beam_lost(fmt::format("the controller reports an error: {} ({})",
                                 emscon::name_of(error.status),
                                 static_cast<std::int32_t>(error.status)));
  }
  if (error.status != Status::MultipleConnectionsNotAllowed || !online()) return TrackerNothing{};
  return give_up(TrackerState::Faulted,
                 fmt::format("refused: {} ({})", emscon::name_of(error.status),
                             static_cast<std::int32_t>(error.status)));
}

TrackerAction TrackerSession::take(const emscon::StatusChange& change) {
  if (!online() || stopped_) return TrackerNothing{};
  switch (change.event) {
    case Event::MeasurementNotReady:
      return beam_lost("the controller is not ready to measure");
    case Event::DistanceSet:
    case Event::MeasurementReady:
      if (without_beam()) restart_when_beam_is_back();
      return TrackerNothing{};
    case Event::LaserWarmedUp:
      return state_ == TrackerState::WaitWarm ? begin() : TrackerAction{TrackerNothing{}};
    case Event::TrackerProcessorClosing:
    case Event::ServerClosing:
      return give_up(TrackerState::Disconnected, "the controller is shutting down");
    case Event::ServerStarted:
      return begin();  // the settings are lost with the server's memory
    default:
      return TrackerNothing{};
  }
}

}  // namespace abbe::drivers

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
    : options_(std::move(options)), settings_(options_), pause_(options_.first_pause) {}

bool TrackerSession::online() const noexcept {
  return state_ != TrackerState::Disconnected && state_ != TrackerState::Faulted &&
         state_ != TrackerState::Connecting;
}

protocol::HostTime TrackerSession::deadline() const noexcept {
  if (stopped_ && !online()) return kNever;
  if (order_ && !order_begun_ && !pending_) return now_;
  // Without a beam the next query is sent only after the answer to the pending one. due_ may have
  // passed meanwhile. It must not count as a deadline, or the device thread would poll without
  // pause.
  auto next = pending_ && without_beam() ? kNever : due_;
  if (pending_) next = std::min(next, pending_->due);
  if (restart_at_ && !pending_) next = std::min(next, *restart_at_);
  return next;
}

TrackerAction TrackerSession::on(const TrackerInput& input, protocol::HostTime now) {
  now_ = now;
  return std::visit([this](const auto& i) { return take(i); }, input);
}

TrackerAction TrackerSession::take(const TrackerTick&) {
  if (pending_ && now_ >= pending_->due)
    return pending_->waiting_to_resend ? send_again() : overdue();
  if (order_ && !order_begun_ && !pending_) return begin_order();
  if (restart_at_ && !pending_ && now_ >= *restart_at_) return start_again();
  if (now_ < due_) return TrackerNothing{};

  switch (state_) {
    case TrackerState::Disconnected:
    case TrackerState::Faulted:
      if (stopped_) return TrackerNothing{};
      state_ = TrackerState::Connecting;
      due_ = now_ + options_.connect_timeout;
      return TrackerOpen{};
    case TrackerState::Connecting:
      return give_up(TrackerState::Disconnected,
                     fmt::format("no connection in {:g} s",
                                 std::chrono::duration<double>(options_.connect_timeout).count()));
    case TrackerState::WaitWarm:
      return begin();
    case TrackerState::Streaming:
      return tick_streaming();
    case TrackerState::BeamLost:
    case TrackerState::WaitBeam:
      return pending_ ? TrackerAction{TrackerNothing{}} : query_status();
    case TrackerState::Stopping:
    case TrackerState::Restoring:
      return plan_done();  // leave_within has passed
    default:
      return TrackerNothing{};
  }
}

TrackerAction TrackerSession::take(const TrackerConnected&) {
  if (state_ != TrackerState::Connecting) return TrackerNothing{};
  return begin();
}

TrackerAction TrackerSession::take(const TrackerConnectionLost& lost) {
  if (state_ == TrackerState::Stopping) {
    pending_.reset();
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
    pending_.reset();
    due_ = kNever;
    state_ = TrackerState::Disconnected;
    return connected ? TrackerAction{TrackerClose{}} : TrackerAction{TrackerNothing{}};
  }

  state_ = TrackerState::Stopping;
  due_ = now_ + options_.leave_within;
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
  pending_.reset();
  restart_at_.reset();
  plan_.clear();
  state_ = into;
  due_ = stopped_ ? kNever : now_ + pause_;
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
      if (without_beam() && !restart_at_) restart_at_ = now_ + options_.resume_within;
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

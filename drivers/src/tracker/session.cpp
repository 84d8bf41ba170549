#include "abbe/drivers/tracker/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace abbe::drivers {
namespace {

using emscon::Command;
using emscon::Event;
using emscon::Status;
using std::chrono::nanoseconds;

/// Points of before a break may still arrive one burst (at most a third of a second) after its report.
constexpr std::chrono::milliseconds kLastBurst{500};

constexpr protocol::HostTime kNever = protocol::HostTime::max();

double seconds(nanoseconds d) {
  return std::chrono::duration<double>(d).count();
}

/// Statuses that waiting mends.
bool passes(Status s) {
  switch (s) {
    case Status::ServerBusy:
    case Status::InternalProcessActive:
    case Status::MeasurementNotReady:
    case Status::AdmStartUpBusy:
    case Status::SystemNotReady:
      return true;
    default:
      return false;
  }
}

std::string said(Status s) {
  return fmt::format("{} ({})", emscon::name_of(s), static_cast<std::int32_t>(s));
}

}  // namespace

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
    case TrackerState::Stopping:
      return "stopping";
    case TrackerState::Faulted:
      return "faulted";
  }
  return "unknown";
}

std::string describe(const TrackerNonsense& nonsense) {
  std::string hex;
  std::string text;
  for (std::size_t i = 0; i < nonsense.length; ++i) {
    const auto value = static_cast<unsigned char>(nonsense.first_bytes[i]);
    hex += fmt::format("{}{:02x}", i == 0 ? "" : " ", value);
    text += value >= 0x20 && value < 0x7f ? static_cast<char>(value) : '.';
  }
  return fmt::format("expected emScon answer, got {} \"{}\" ({})", hex, text,
                     nonsense.error ? emscon::name_of(*nonsense.error) : "a packet size that cannot be");
}

Result<void> check(const TrackerSessionOptions& o) {
  const auto bad = [&](const char* what) -> Result<void> {
    return tl::unexpected{Error{ErrorCode::BadConfiguration, fmt::format("{}: {}", o.peer, what)}};
  };
  if (o.time_separation_ms < 1 || o.time_separation_ms > 60'000)
    return bad("time separation not in 1 to 60000 ms");
  if (!(o.spatial_distance_mm > 0.0)) return bad("spatial distance not above 0 mm");
  if (o.stationary_time_ms < 1 || o.stationary_time_ms > 60'000)
    return bad("stationary time not in 1 to 60000 ms");
  if (o.packets_per_second < 3 || o.packets_per_second > 10)
    return bad("packet rate not in 3 to 10 per second");
  if (o.first_pause <= nanoseconds{0} || o.longest_pause < o.first_pause)
    return bad("pauses between tries not rising");
  return {};
}

TrackerSession::TrackerSession(TrackerSessionOptions options)
    : options_(std::move(options)), pause_(options_.first_pause) {
  write_script();
}

/// The order matters to a controller: units before everything that has one, parameters of a mode after the
/// mode.
void TrackerSession::write_script() {
  using enum TrackerState;
  const auto add = [this](TrackerState state, const emscon::Request& request, bool optional = false) {
    script_.push_back({state, request, optional});
  };
  const auto required = [&](TrackerState state, const emscon::Request& request) { add(state, request); };
  emscon::SystemSettings settings;
  settings.weather_monitor = options_.weather;

  required(Querying, emscon::GetSystemStatus{});
  required(Configuring, emscon::SetUnits{});
  required(Configuring, emscon::SetSystemSettings{settings});
  if (options_.weather == emscon::WeatherMonitor::None) {
    required(Configuring, emscon::SetEnvironmentParams{options_.environment});
  }
  required(Initialising, emscon::Initialize{});
  if (options_.reflector_id) required(Configuring, emscon::SetReflector{*options_.reflector_id});
  if (options_.go_bird_bath) required(Initialising, emscon::GoBirdBath{});
  required(Configuring, emscon::SetStationOrientation{});
  required(Configuring, emscon::SetTransformation{});
  required(Configuring, emscon::SetCoordinateSystemType{emscon::CoordinateSystem::RightHanded});
  add(Configuring, emscon::SetStatisticMode{}, true);  // AT40x has no statistics to choose
  switch (options_.mode) {
    case TrackerMode::ContinuousTime:
      required(Configuring, emscon::SetMeasurementMode{emscon::MeasurementMode::ContinuousTime});
      required(Configuring, emscon::SetContinuousTimeModeParams{options_.time_separation_ms});
      break;
    case TrackerMode::ContinuousDistance:
      required(Configuring, emscon::SetMeasurementMode{emscon::MeasurementMode::ContinuousDistance});
      required(Configuring, emscon::SetContinuousDistanceModeParams{options_.spatial_distance_mm});
      break;
    case TrackerMode::Stationary:
      required(Configuring, emscon::SetMeasurementMode{emscon::MeasurementMode::Stationary});
      required(Configuring, emscon::SetStationaryModeParams{options_.stationary_time_ms, true});
      break;
  }
  if (options_.mode != TrackerMode::Stationary) {  // older controllers have a fixed rate
    add(Configuring,
        emscon::SetLongSystemParameter{emscon::LongParameter::TcpDataPacketRate, options_.packets_per_second},
        true);
  }
  required(Ready, emscon::StartMeasurement{});
}

bool TrackerSession::online() const noexcept {
  return state_ != TrackerState::Disconnected && state_ != TrackerState::Faulted &&
         state_ != TrackerState::Connecting;
}

protocol::HostTime TrackerSession::deadline() const noexcept {
  if (stopped_ && !online()) return kNever;
  auto next = pending_ ? std::min(pending_->due, due_) : due_;
  if (restart_at_ && !pending_) next = std::min(next, *restart_at_);
  return next;
}

TrackerAction TrackerSession::on(const TrackerInput& input, protocol::HostTime now) {
  now_ = now;
  return std::visit([this](const auto& i) { return take(i); }, input);
}

// --- the connection
// -------------------------------------------------------------------------------------------------

TrackerAction TrackerSession::take(const TrackerTick&) {
  if (pending_ && now_ >= pending_->due) return pending_->waiting_to_resend ? send_again() : overdue();
  if (restart_at_ && !pending_ && now_ >= *restart_at_) return start_again();
  if (stopped_ || now_ < due_) return TrackerNothing{};
  switch (state_) {
    case TrackerState::Disconnected:
    case TrackerState::Faulted:
      state_ = TrackerState::Connecting;
      due_ = now_ + options_.connect_timeout;
      return TrackerOpen{};
    case TrackerState::Connecting:
      return give_up(TrackerState::Disconnected,
                     fmt::format("no connection in {:g} s", seconds(options_.connect_timeout)));
    case TrackerState::WaitWarm:
      return begin_script();
    case TrackerState::Streaming:
      return tick_streaming();
    case TrackerState::BeamLost:
      return pending_ ? TrackerAction{TrackerNothing{}} : ask_alive();
    default:
      return TrackerNothing{};
  }
}

TrackerAction TrackerSession::take(const TrackerConnected&) {
  if (state_ != TrackerState::Connecting) return TrackerNothing{};
  return begin_script();
}

TrackerAction TrackerSession::take(const TrackerConnectionLost& lost) {
  if (state_ == TrackerState::Stopping) {
    pending_.reset();
    state_ = TrackerState::Disconnected;
    return TrackerNothing{};
  }
  if (state_ != TrackerState::Connecting && !online()) return TrackerNothing{};
  give_up(TrackerState::Disconnected, lost.what);
  return TrackerNothing{};  // there is nothing to close any more
}

TrackerAction TrackerSession::take(const TrackerNonsense& nonsense) {
  if (!online()) return TrackerNothing{};
  return give_up(TrackerState::Faulted, describe(nonsense));
}

TrackerAction TrackerSession::take(const TrackerStopRequested&) {
  if (std::exchange(stopped_, true)) return TrackerNothing{};
  const bool measuring = state_ == TrackerState::Streaming || state_ == TrackerState::BeamLost;
  const bool connected = online() || state_ == TrackerState::Connecting;
  due_ = kNever;
  restart_at_.reset();
  pending_.reset();
  state_ = measuring ? TrackerState::Stopping : TrackerState::Disconnected;
  if (measuring) return send({TrackerState::Stopping, emscon::StopMeasurement{}, true}, false);
  return connected ? TrackerAction{TrackerClose{}} : TrackerAction{TrackerNothing{}};
}

TrackerAction TrackerSession::give_up(TrackerState into, const std::string& what) {
  fault_.text = fmt::format("{}: {}", options_.peer, what);
  ++fault_.count;
  pending_.reset();
  restart_at_.reset();
  state_ = into;
  due_ = stopped_ ? kNever : now_ + pause_;
  pause_ = std::min(2 * pause_, options_.longest_pause);
  return TrackerClose{};
}

// --- commands
// -------------------------------------------------------------------------------------------------------

nanoseconds TrackerSession::time_for(Command command) const noexcept {
  const bool moves = command == Command::Initialize || command == Command::GoBirdBath;
  return moves ? options_.initialize_timeout : options_.command_timeout;
}

TrackerAction TrackerSession::begin_script() {
  step_ = 0;
  due_ = kNever;
  restart_at_.reset();
  return next_step();
}

TrackerAction TrackerSession::next_step() {
  if (step_ == script_.size()) {
    streaming();
    return TrackerNothing{};
  }
  const Step& step = script_[step_++];
  state_ = step.state;
  return send(step, true);
}

TrackerAction TrackerSession::send(const Step& step, bool scripted) {
  const emscon::Request request = step.request;
  pending_ = Pending{.step = step, .scripted = scripted, .patience = now_ + options_.busy_patience};
  await_answer();
  return TrackerSend{request};
}

void TrackerSession::await_answer() {
  pending_->overdue = now_ + time_for(emscon::command_of(pending_->step.request));
  const bool first = state_ == TrackerState::Querying;
  pending_->due = first ? std::min(now_ + options_.ask_again, pending_->overdue) : pending_->overdue;
}

TrackerAction TrackerSession::send_again() {
  pending_->waiting_to_resend = false;
  await_answer();
  return TrackerSend{pending_->step.request};
}

TrackerAction TrackerSession::overdue() {
  if (now_ < pending_->overdue) {
    pending_->due = std::min(now_ + options_.ask_again, pending_->overdue);
    return TrackerSend{pending_->step.request};
  }
  const Command command = emscon::command_of(pending_->step.request);
  if (state_ == TrackerState::Stopping) {
    pending_.reset();
    state_ = TrackerState::Disconnected;
    return TrackerClose{};
  }
  return give_up(TrackerState::Faulted, fmt::format("no answer to {} in {:g} s", emscon::name_of(command),
                                                    seconds(time_for(command))));
}

TrackerAction TrackerSession::take(const emscon::Answer& answer) {
  const bool awaited = pending_ && !pending_->waiting_to_resend &&
                       emscon::command_of(pending_->step.request) == emscon::command_of(answer);
  if (!awaited) return TrackerNothing{};  // of an earlier client, or of a second GetReflectors
  const Status status = emscon::status_of(answer);
  if (emscon::accepted(status) || pending_->step.optional) return done(answer);
  return refused(status);
}

TrackerAction TrackerSession::refused(Status status) {
  if (!pending_->scripted && state_ != TrackerState::Ready) return start_refused();
  if (status == Status::NotWarmedUp) {
    pending_.reset();
    state_ = TrackerState::WaitWarm;
    due_ = now_ + options_.warm_poll;
    return TrackerNothing{};
  }
  if (passes(status) && now_ < pending_->patience) {
    pending_->waiting_to_resend = true;
    pending_->due = now_ + options_.busy_retry;
    return TrackerNothing{};
  }
  const char* command = emscon::name_of(emscon::command_of(pending_->step.request));
  return give_up(TrackerState::Faulted, fmt::format("{} was refused: {}", command, said(status)));
}

/// After a lost beam StartMeasurement may be refused. If because the old measurement still runs, stopping it
/// is what helps; if not, it does no harm. If points came meanwhile, the old measurement runs and all is
/// well.
TrackerAction TrackerSession::start_refused() {
  pending_.reset();
  if (state_ != TrackerState::BeamLost) return TrackerNothing{};
  return send({TrackerState::BeamLost, emscon::StopMeasurement{}, true}, false);
}

TrackerAction TrackerSession::done(const emscon::Answer& answer) {
  const Pending was = *std::exchange(pending_, std::nullopt);
  if (const auto* status = std::get_if<emscon::SystemStatusAnswer>(&answer)) return judge(*status);
  if (was.scripted) return next_step();
  if (state_ == TrackerState::Stopping) {
    state_ = TrackerState::Disconnected;
    return TrackerClose{};
  }
  if (state_ == TrackerState::Ready) streaming();
  return state_ == TrackerState::BeamLost ? done_without_beam(answer) : TrackerAction{TrackerNothing{}};
}

TrackerAction TrackerSession::done_without_beam(const emscon::Answer& answer) {
  const Command command = emscon::command_of(answer);
  if (command == Command::StartMeasurement) streaming();
  if (command == Command::StopMeasurement) return ask_alive();
  const auto* tracker = std::get_if<emscon::TrackerStatusAnswer>(&answer);
  if (tracker != nullptr && tracker->tracker == emscon::TrackerStatus::Ready && !restart_at_) {
    restart_at_ = now_ + options_.resume_within;  // the event that says so was missed
  }
  return TrackerNothing{};
}

TrackerAction TrackerSession::judge(const emscon::SystemStatusAnswer& status) {
  switch (status.laser) {
    case emscon::LaserStatus::Heating:
      state_ = TrackerState::WaitWarm;
      due_ = now_ + options_.warm_poll;
      return TrackerNothing{};
    case emscon::LaserStatus::CommunicationFailed:
      return give_up(TrackerState::Faulted, "the controller does not reach the laser");
    case emscon::LaserStatus::Unable:
      return give_up(TrackerState::Faulted, "the laser is unable to measure");
    case emscon::LaserStatus::Off:
      return give_up(TrackerState::Faulted, "the laser is off");
    case emscon::LaserStatus::NotAvailable:
    case emscon::LaserStatus::Ready:
      break;
  }
  return next_step();
}

// --- measuring
// ------------------------------------------------------------------------------------------------------

/// Continuous distance has no period: a machine that stands still sends nothing, and only the controller can
/// be asked.
nanoseconds TrackerSession::silence_allowed() const noexcept {
  switch (options_.mode) {
    case TrackerMode::ContinuousTime:
      return std::max<nanoseconds>(options_.silence_timeout,
                                   3 * std::chrono::milliseconds{options_.time_separation_ms});
    case TrackerMode::Stationary:
      return options_.silence_timeout + 3 * std::chrono::milliseconds{options_.stationary_time_ms};
    case TrackerMode::ContinuousDistance:
      break;
  }
  return options_.keep_alive;
}

void TrackerSession::streaming() {
  state_ = TrackerState::Streaming;
  restart_at_.reset();
  due_ = now_ + silence_allowed();
}

TrackerAction TrackerSession::tick_streaming() {
  if (options_.mode == TrackerMode::ContinuousDistance) return ask_alive();
  return give_up(TrackerState::Faulted, fmt::format("no points in {:g} s", seconds(silence_allowed())));
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
  if (state_ == TrackerState::BeamLost) {
    if (!restart_at_ && now_ - beam_lost_at_ < kLastBurst) return TrackerNothing{};
    streaming();
  }
  if (state_ != TrackerState::Streaming) return TrackerNothing{};
  pause_ = options_.first_pause;
  due_ = now_ + silence_allowed();
  if (options_.mode != TrackerMode::Stationary || pending_) return TrackerNothing{};
  state_ = TrackerState::Ready;  // one result for one StartMeasurement
  due_ = kNever;
  return send({TrackerState::Ready, emscon::StartMeasurement{}, false}, false);
}

TrackerAction TrackerSession::beam_lost() {
  if (state_ != TrackerState::Streaming && state_ != TrackerState::BeamLost) return TrackerNothing{};
  state_ = TrackerState::BeamLost;
  beam_lost_at_ = now_;
  restart_at_.reset();
  due_ = now_ + options_.keep_alive;
  return TrackerNothing{};
}

TrackerAction TrackerSession::take(const emscon::ErrorResponse& error) {
  if (state_ == TrackerState::Streaming || state_ == TrackerState::BeamLost) return beam_lost();
  if (error.status != Status::MultipleConnectionsNotAllowed || !online()) return TrackerNothing{};
  return give_up(TrackerState::Faulted, fmt::format("refused: {}", said(error.status)));
}

TrackerAction TrackerSession::take(const emscon::StatusChange& change) {
  if (!online() || stopped_) return TrackerNothing{};
  switch (change.event) {
    case Event::MeasurementNotReady:
      return beam_lost();
    case Event::DistanceSet:
    case Event::MeasurementReady:
      if (state_ == TrackerState::BeamLost && !restart_at_) restart_at_ = now_ + options_.resume_within;
      return TrackerNothing{};
    case Event::LaserWarmedUp:
      return state_ == TrackerState::WaitWarm ? begin_script() : TrackerAction{TrackerNothing{}};
    case Event::TrackerProcessorClosing:
    case Event::ServerClosing:
      return give_up(TrackerState::Disconnected, "the controller is shutting down");
    case Event::ServerStarted:
      return begin_script();  // what was set is lost with its memory
    default:
      return TrackerNothing{};
  }
}

}  // namespace abbe::drivers

#pragma once
/// Command state machine of a client of an emScon controller, without its socket. Sans-I/O: one
/// input and the host time in, at most one action out. The order of commands is that of the
/// manufacturer's manual: status, units, settings, environment, Initialize, reflector, bird bath,
/// coordinates, mode, StartMeasurement. One command at a time. Not real-time: allocates. One
/// thread.
///
///   Disconnected -> Connecting -> Querying [-> WaitWarm] -> Configuring [-> Initialising] -> Ready
///     -> Streaming <-> BeamLost
///
///   Ready -> WaitBeam -> Streaming                       (there is no beam yet)
///   Streaming, BeamLost, WaitBeam -> Moving -> Ready     (an order)
///   any -> Stopping -> Disconnected
///   any -> [Restoring ->] Faulted -> Connecting          (after a pause)
///
/// Disconnected: the connection failed or ended. Faulted: the controller's answer was malformed,
/// missing, or a refusal that is not temporary. In both states the session connects again after a
/// pause, which doubles with each attempt until points arrive.
///
/// Initialize loses the beam and moves the head. It is sent only to a controller that reports that
/// it is not initialised, or by order. While there is no beam the session waits and sends no
/// command that moves the tracker, so as not to disturb the operator with the reflector. Each
/// setting is read before it is set, and restored when the session ends.

#include <array>
#include <chrono>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "abbe/drivers/deadlines.hpp"
#include "abbe/drivers/error.hpp"
#include "abbe/drivers/tracker/order.hpp"
#include "abbe/drivers/tracker/receiver.hpp"
#include "abbe/drivers/tracker/settings.hpp"
#include "abbe/protocol/emscon/requests.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

enum class TrackerState {
  Disconnected,
  Connecting,
  Querying,
  WaitWarm,
  Configuring,
  Initialising,
  Ready,
  Streaming,
  BeamLost,
  WaitBeam,
  Moving,
  Restoring,
  Stopping,
  Faulted,
};
/// Text for messages: "streaming", "beam lost", ...
[[nodiscard]] const char* name_of(TrackerState) noexcept;

enum class TrackerMode {
  ContinuousTime,      ///< a point every `time_separation_ms`
  ContinuousDistance,  ///< a point every `spatial_distance_mm`
  Stationary,          ///< consecutive means over `stationary_time_ms`
};

struct TrackerSessionOptions {
  std::string peer = "tracker";  ///< name in messages: "tracker 10.0.0.7:700"
  TrackerMode mode = TrackerMode::ContinuousTime;
  std::int32_t time_separation_ms = 2;  ///< 500 points per second
  double spatial_distance_mm = 1.0;
  std::int32_t stationary_time_ms = 500;
  std::int32_t packets_per_second = 10;  ///< 3 to 10; a refusal by the controller is no fault
  std::string reflector;               ///< name or id; empty: the one that is set in the controller
  bool home_after_initialize = false;  ///< send GoBirdBath after Initialize
  /// Search radius in mm and time-out of FindReflector; nullopt: the values set in the controller.
  std::optional<emscon::SetSearchParams> search;
  emscon::WeatherMonitor weather = emscon::WeatherMonitor::ReadAndCompute;
  /// State of the air in Celsius, mbar, percent; sent to the controller if `weather` is None.
  emscon::Environment environment;

  std::chrono::nanoseconds connect_timeout = std::chrono::seconds{3};
  std::chrono::nanoseconds command_timeout = std::chrono::seconds{3};
  /// The first query of a connection is repeated at this interval: a controller that was not
  /// reachable answers as soon as it is reachable again.
  std::chrono::nanoseconds ask_again = std::chrono::milliseconds{250};
  /// Time-out of Initialize and GoBirdBath, and of FindReflector without `search`.
  std::chrono::nanoseconds initialize_timeout = std::chrono::seconds{120};
  /// While streaming, it is a fault if no packet arrives for this long.
  std::chrono::nanoseconds silence_timeout = std::chrono::milliseconds{1500};
  /// Pause before repeating a command that the controller refused with "busy" or "not ready".
  std::chrono::nanoseconds busy_retry = std::chrono::milliseconds{250};
  /// It is a fault if the controller reports "busy" for longer than this.
  std::chrono::nanoseconds busy_patience = std::chrono::seconds{120};
  /// Interval of status queries while the laser is heating.
  std::chrono::nanoseconds warm_poll = std::chrono::seconds{5};
  /// StartMeasurement is sent again if no point arrives within this time after the beam is back.
  std::chrono::nanoseconds resume_within = std::chrono::seconds{1};
  /// Interval of status queries to a controller that sends nothing.
  std::chrono::nanoseconds keep_alive = std::chrono::seconds{5};
  /// Pause before connecting again; it doubles with each attempt up to longest_pause.
  std::chrono::nanoseconds first_pause = std::chrono::milliseconds{250};
  /// Longest pause between two attempts to connect: a tracker that is reachable again then streams
  /// within a second.
  std::chrono::nanoseconds longest_pause = std::chrono::milliseconds{500};
  /// Pause before connecting again after a refused command.
  std::chrono::nanoseconds refused_pause = std::chrono::seconds{5};
  /// Longest time for stopping the measurement and restoring the settings.
  std::chrono::nanoseconds leave_within = std::chrono::seconds{5};
};
/// Error BadConfiguration; the text names the option that is out of range.
[[nodiscard]] Result<void> check(const TrackerSessionOptions& options);
/// Time within which an order is reported. It may take longer only if the controller is busy before
/// several commands.
[[nodiscard]] std::chrono::nanoseconds longest_order(const TrackerSessionOptions& options) noexcept;

// Inputs. Answers, errors, status changes and protocol errors of the receiver are passed unchanged.
struct TrackerConnected {};
struct TrackerConnectionLost {
  std::string what;  ///< "connection refused", "closed by peer"
};
struct TrackerPointsArrived {
  std::size_t count = 0;
};
struct TrackerTick {};  ///< input: time has passed; send it at deadline()
/// input: restore the settings, disconnect, and do not connect again
struct TrackerStopRequested {};
using TrackerInput =
    std::variant<TrackerTick, TrackerConnected, TrackerConnectionLost, TrackerPointsArrived,
                 emscon::Answer, emscon::ErrorResponse, emscon::StatusChange, TrackerProtocolError,
                 TrackerStopRequested, TrackerOrder>;

// Actions.
struct TrackerNothing {};
/// Action: open a connection; the input TrackerConnected or TrackerConnectionLost follows.
struct TrackerOpen {};
/// Action: close the connection; no TrackerConnectionLost follows.
struct TrackerClose {};
struct TrackerSend {
  emscon::Request request;
};
using TrackerAction = std::variant<TrackerNothing, TrackerOpen, TrackerClose, TrackerSend>;

class TrackerSession {
 public:
  /// Precondition: `options` have passed check().
  explicit TrackerSession(TrackerSessionOptions options);

  [[nodiscard]] TrackerAction on(const TrackerInput& input, protocol::HostTime now);

  [[nodiscard]] TrackerState state() const noexcept { return state_; }
  /// The time at which the next TrackerTick is due.
  [[nodiscard]] protocol::HostTime deadline() const noexcept { return deadlines_.next(waiting()); }

  struct Fault {
    std::uint64_t count = 0;  ///< number of faults since construction
    /// text of the latest fault: "tracker 10.0.0.7:700: no answer to SetUnits in 3 s"
    std::string text;
  };
  [[nodiscard]] const Fault& fault() const noexcept { return fault_; }
  /// The reason why no points arrive, and the remedy; empty while points arrive.
  [[nodiscard]] const std::string& cause() const noexcept { return cause_; }
  /// The report of the latest order; nullopt if there is none, or if it was already taken.
  [[nodiscard]] std::optional<TrackerOrderReport> take_report() {
    return std::exchange(report_, std::nullopt);
  }
  /// True if the session was stopped and is disconnected.
  [[nodiscard]] bool has_left() const noexcept { return stopped_ && !online(); }

 private:
  using Outcome = TrackerOrderReport::Outcome;
  struct Step {
    std::optional<TrackerState> state;  ///< session's state from this step on; none: unchanged
    emscon::Request request;
    bool optional = false;  ///< a refusal counts as done
    bool of_order = false;  ///< a refusal ends the order, not the session
  };
  /// The action after the last step of a plan (a list of commands to send).
  enum class Goal { SetUp, Stream, Stay, Leave, GiveUp };
  struct Pending {
    Step step;
    bool scripted = false;
    bool waiting_to_resend = false;
    protocol::HostTime patience{};  ///< "busy" is tolerated until then
  };
  enum class Due {
    Answer,   ///< no answer to the pending command by then: a fault
    Repeat,   ///< sends the pending command again
    Order,    ///< begins the accepted order
    Restart,  ///< sends StartMeasurement after the beam is back
    // Purposes that belong to the state: at most one of the following deadlines is set.
    Connect,
    Connection,  ///< no connection by then: a fault
    WarmUp,      ///< status query while the laser is heating
    Points,      ///< no point by then: a fault, or a status query
    Query,       ///< status query while there is no beam
    Leave,       ///< if the settings are not restored by then, restoring is given up
  };
  static constexpr std::array kOfState{Due::Connect, Due::Connection, Due::WarmUp,
                                       Due::Points,  Due::Query,      Due::Leave};
  /// Purposes that send a command. One command is sent at a time, so they wait until the pending
  /// command is answered.
  static constexpr std::array kAfterAnswer{Due::Order, Due::Restart, Due::Query};

  TrackerAction take(const TrackerTick&);
  TrackerAction take(const TrackerConnected&);
  TrackerAction take(const TrackerConnectionLost& lost);
  TrackerAction take(const TrackerPointsArrived& arrived);
  TrackerAction take(const emscon::Answer& answer);
  TrackerAction take(const emscon::ErrorResponse& error);
  TrackerAction take(const emscon::StatusChange& change);
  TrackerAction take(const TrackerProtocolError& malformed);
  TrackerAction take(const TrackerStopRequested&);
  TrackerAction take(const TrackerOrder& order);

  /// Sets the deadline of the present state and cancels that of the previous state.
  void in_state(Due due, std::chrono::nanoseconds within);
  void without_deadline_of_state();
  [[nodiscard]] std::span<const Due> waiting() const noexcept {
    return pending_ ? std::span<const Due>{kAfterAnswer} : std::span<const Due>{};
  }
  TrackerAction connect();
  void connect_after(std::chrono::nanoseconds pause);
  TrackerAction begin();
  void plan_set_up(bool initialised);
  void plan_sets(std::initializer_list<emscon::Command> commands, bool optional = false);
  void plan_reflector(TrackerState state, bool of_order);
  void plan_restoring(TrackerState state);
  void plan(std::optional<TrackerState> state, const emscon::Request& request,
            bool optional = false, bool of_order = false) {
    plan_.push_back({state, request, optional, of_order});
  }
  void new_plan(Goal goal);
  TrackerAction next_step();
  TrackerAction plan_done();
  TrackerAction send(const Step& step, bool scripted);
  void end_pending();
  TrackerAction repeat();
  TrackerAction send_later();
  TrackerAction refused(emscon::Status status);
  TrackerAction refuse(const std::string& what);
  TrackerAction wait_for_beam(const std::string& why);
  TrackerAction start_refused();
  TrackerAction begin_order();
  void end_order(Outcome outcome, const std::string& text);
  [[nodiscard]] std::string outcome_of(const TrackerOrder& order) const;
  [[nodiscard]] bool takes_orders() const noexcept;
  [[nodiscard]] bool without_beam() const noexcept {
    return state_ == TrackerState::BeamLost || state_ == TrackerState::WaitBeam;
  }
  void keep(const emscon::Answer& answer);
  [[nodiscard]] bool list_complete(const emscon::Answer& answer);
  [[nodiscard]] std::string choose_reflector();
  [[nodiscard]] const std::string& wanted_reflector() const;
  void note_fault(const std::string& what);
  TrackerAction done(const emscon::Answer& answer);
  TrackerAction done_without_beam(const emscon::Answer& answer);
  TrackerAction evaluate(const emscon::SystemStatusAnswer& status);
  void await_answer();
  TrackerAction overdue();
  TrackerAction tick_streaming();
  TrackerAction measure_again();
  /// Call it when the controller reports that the beam is back. It plans StartMeasurement after
  /// resume_within; a point that arrives before then cancels it.
  void restart_when_beam_is_back();
  TrackerAction start_again();
  TrackerAction query_status();
  TrackerAction beam_lost(const std::string& why);
  void streaming();
  TrackerAction give_up(TrackerState into, const std::string& what);
  [[nodiscard]] bool online() const noexcept;
  [[nodiscard]] std::chrono::nanoseconds time_for(emscon::Command command) const noexcept;
  [[nodiscard]] std::chrono::nanoseconds silence_allowed() const noexcept;

  TrackerSessionOptions options_;
  TrackerSettings settings_;
  std::vector<Step> plan_;
  Goal goal_ = Goal::Stream;
  bool initialised_ = false;  ///< state that the controller reported on this connection
  TrackerState state_ = TrackerState::Disconnected;
  protocol::HostTime now_{};
  std::size_t step_ = 0;
  std::optional<Pending> pending_;
  Deadlines<Due::Leave> deadlines_;
  std::chrono::nanoseconds pause_{};
  protocol::HostTime beam_lost_at_{};
  bool result_came_ = false;  ///< Stationary: the result of the latest StartMeasurement arrived
  bool stopped_ = false;
  Fault fault_;
  std::string cause_;
  std::vector<TrackerReflector> reflectors_;  ///< list of the controller, as far as received
  std::optional<std::int32_t> reflector_in_use_;
  /// reflector that was set before the configured one
  std::optional<std::int32_t> reflector_before_;
  std::optional<TrackerOrder> order_;  ///< accepted, not yet reported
  bool order_begun_ = false;
  std::optional<TrackerOrderReport> report_;
};

/// Text such as "expected emScon answer, got 48 54 54 50 \"HTTP...\"".
[[nodiscard]] std::string describe(const TrackerProtocolError& malformed);

}  // namespace abbe::drivers

#pragma once
/// What to ask an emScon controller, and when: the command state machine of a tracker, without its
/// socket. Sans-I/O: one input and the host time in, at most one action out. The order of commands
/// is the one of the manufacturer's manual: status, units, settings, environment, Initialize,
/// reflector, bird bath, coordinates, mode, StartMeasurement. One command at a time. Ordinary
/// world: allocates. One thread.
///
///   Disconnected -> Connecting -> Querying [-> WaitWarm] -> Configuring [-> Initialising] -> Ready
///     -> Streaming <-> BeamLost;   Ready -> WaitBeam -> Streaming (no beam yet);   Streaming, BeamLost,
///     WaitBeam -> Moving -> Ready (an order);   any -> Stopping -> Disconnected;   any -> [Restoring ->]
///     Faulted -> Connecting (after a while)
///
/// Disconnected: the connection failed or ended. Faulted: the peer answered, but wrongly, late or
/// with a refusal that waiting does not mend. Both try again, after a pause that doubles from try
/// to try until points come.
///
/// Initialize drops the beam and moves the head: it is sent only to a controller that reports
/// itself not initialised, or on order. A beam that is not there is waited for: who carries the
/// reflector needs an undisturbed tracker. What is set is read before, and put back when abbe
/// leaves.

#include <chrono>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

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
/// A literal: "streaming", "beam lost", ...
[[nodiscard]] const char* name_of(TrackerState) noexcept;

enum class TrackerMode {
  ContinuousTime,      ///< a point every `time_separation_ms`
  ContinuousDistance,  ///< a point every `spatial_distance_mm`
  Stationary,          ///< one mean of `stationary_time_ms` after the other
};

struct TrackerSessionOptions {
  std::string peer = "tracker";  ///< how messages name it: "tracker 10.0.0.7:700"
  TrackerMode mode = TrackerMode::ContinuousTime;
  std::int32_t time_separation_ms = 2;  ///< 500 points per second
  double spatial_distance_mm = 1.0;
  std::int32_t stationary_time_ms = 500;
  std::int32_t packets_per_second =
      10;                 ///< 3 to 10, what the controller offers; a refusal is no fault
  std::string reflector;  ///< name or id; empty: the one that is set in the controller
  bool home_after_initialize = false;  ///< GoBirdBath, when abbe had to initialise the tracker
  std::optional<emscon::SetSearchParams> search;  ///< radius in mm; none: as set in the controller
  emscon::WeatherMonitor weather = emscon::WeatherMonitor::ReadAndCompute;
  emscon::Environment
      environment;  ///< Celsius, mbar, percent; told to the controller if `weather` is None

  std::chrono::nanoseconds connect_timeout = std::chrono::seconds{3};
  std::chrono::nanoseconds command_timeout = std::chrono::seconds{3};
  /// The first question of a connection is repeated: who was away hears it as soon as he is back.
  std::chrono::nanoseconds ask_again = std::chrono::milliseconds{250};
  /// Initialize and GoBirdBath
  std::chrono::nanoseconds initialize_timeout = std::chrono::seconds{120};
  /// no packet while streaming
  std::chrono::nanoseconds silence_timeout = std::chrono::milliseconds{1500};
  /// after "busy" or "not ready"
  std::chrono::nanoseconds busy_retry = std::chrono::milliseconds{250};
  /// "busy" for longer is a fault
  std::chrono::nanoseconds busy_patience = std::chrono::seconds{120};
  /// how often a heating laser is asked
  std::chrono::nanoseconds warm_poll = std::chrono::seconds{5};
  /// beam back: then StartMeasurement again
  std::chrono::nanoseconds resume_within = std::chrono::seconds{1};
  /// how often a quiet controller is asked
  std::chrono::nanoseconds keep_alive = std::chrono::seconds{5};
  /// before connecting again, doubled ...
  std::chrono::nanoseconds first_pause = std::chrono::milliseconds{250};
  /// ... up to this: whoever is back streams within a second
  std::chrono::nanoseconds longest_pause = std::chrono::milliseconds{500};
  /// after a refusal of a command
  std::chrono::nanoseconds refused_pause = std::chrono::seconds{5};
  /// stop and put back the settings
  std::chrono::nanoseconds leave_within = std::chrono::seconds{5};
};
/// BadConfiguration says which option is out of its range.
[[nodiscard]] Result<void> check(const TrackerSessionOptions& options);
/// After which an order has been reported; longer only where the controller is busy before several
/// commands.
[[nodiscard]] std::chrono::nanoseconds longest_order(const TrackerSessionOptions& options) noexcept;

// Inputs. Answers, errors, status changes and nonsense come from the receiver as they are.
struct TrackerConnected {};
struct TrackerConnectionLost {
  std::string what;  ///< "connection refused", "closed by peer"
};
struct TrackerPointsArrived {
  std::size_t count = 0;
};
struct TrackerTick {};           ///< time has passed; send one at deadline()
struct TrackerStopRequested {};  ///< end politely and stay away
using TrackerInput =
    std::variant<TrackerTick, TrackerConnected, TrackerConnectionLost, TrackerPointsArrived,
                 emscon::Answer, emscon::ErrorResponse, emscon::StatusChange, TrackerProtocolError,
                 TrackerStopRequested, TrackerOrder>;

// Actions.
struct TrackerNothing {};
struct TrackerOpen {};   ///< open a connection, then say TrackerConnected or TrackerConnectionLost
struct TrackerClose {};  ///< close it; no TrackerConnectionLost is expected
struct TrackerSend {
  emscon::Request request;
};
using TrackerAction = std::variant<TrackerNothing, TrackerOpen, TrackerClose, TrackerSend>;

class TrackerSession {
 public:
  /// `options` have passed check().
  explicit TrackerSession(TrackerSessionOptions options);

  [[nodiscard]] TrackerAction on(const TrackerInput& input, protocol::HostTime now);

  [[nodiscard]] TrackerState state() const noexcept { return state_; }
  /// When the next TrackerTick is due.
  [[nodiscard]] protocol::HostTime deadline() const noexcept;

  struct Fault {
    std::uint64_t count = 0;  ///< since construction
    std::string text;         ///< the latest: "tracker 10.0.0.7:700: no answer to SetUnits in 3 s"
  };
  [[nodiscard]] const Fault& fault() const noexcept { return fault_; }
  /// Why no points come, with what to do about it; empty while they come.
  [[nodiscard]] const std::string& cause() const noexcept { return cause_; }
  /// Of the latest order, once.
  [[nodiscard]] std::optional<TrackerOrderReport> take_report() {
    return std::exchange(report_, std::nullopt);
  }
  /// Stopped, and nothing is left to say to the controller.
  [[nodiscard]] bool has_left() const noexcept { return stopped_ && !online(); }

 private:
  using Outcome = TrackerOrderReport::Outcome;
  struct Step {
    TrackerState state{};
    emscon::Request request;
    bool optional = false;  ///< a refusal is taken as done
    bool of_order = false;  ///< a refusal ends the order, not the session
  };
  /// What follows the last step of a plan.
  enum class Goal { SetUp, Stream, Stay, Leave, GiveUp };
  struct Pending {
    Step step;
    bool scripted = false;
    bool waiting_to_resend = false;
    protocol::HostTime due{};       ///< of the answer, or of sending it again
    protocol::HostTime overdue{};   ///< no answer until here is a fault
    protocol::HostTime patience{};  ///< "busy" until here is borne
  };

  TrackerAction take(const TrackerTick&);
  TrackerAction take(const TrackerConnected&);
  TrackerAction take(const TrackerConnectionLost& lost);
  TrackerAction take(const TrackerPointsArrived& arrived);
  TrackerAction take(const emscon::Answer& answer);
  TrackerAction take(const emscon::ErrorResponse& error);
  TrackerAction take(const emscon::StatusChange& change);
  TrackerAction take(const TrackerProtocolError& nonsense);
  TrackerAction take(const TrackerStopRequested&);
  TrackerAction take(const TrackerOrder& order);

  TrackerAction begin();
  void plan_set_up(bool initialised);
  void plan_sets(std::initializer_list<emscon::Command> commands, bool optional = false);
  void plan_reflector(TrackerState state, bool of_order);
  void plan_restoring(TrackerState state);
  void plan(TrackerState state, const emscon::Request& request, bool optional = false,
            bool of_order = false) {
    plan_.push_back({state, request, optional, of_order});
  }
  void new_plan(Goal goal);
  TrackerAction next_step();
  TrackerAction plan_done();
  TrackerAction send(const Step& step, bool scripted);
  TrackerAction send_again();
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
  TrackerAction judge(const emscon::SystemStatusAnswer& status);
  void await_answer();
  TrackerAction overdue();
  TrackerAction tick_streaming();
  TrackerAction measure_again();
  TrackerAction start_again();
  TrackerAction ask_alive();
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
  bool initialised_ = false;  ///< as the controller reported on this connection
  TrackerState state_ = TrackerState::Disconnected;
  protocol::HostTime now_{};
  std::size_t step_ = 0;
  std::optional<Pending> pending_;
  protocol::HostTime
      /// of what the state waits for: reconnecting, connection, warm-up, points, keep-alive
      due_{};
  std::chrono::nanoseconds pause_{};
  protocol::HostTime beam_lost_at_{};
  std::optional<protocol::HostTime>
      restart_at_;            ///< the beam is back: StartMeasurement, should no point come before
  bool result_came_ = false;  ///< Stationary: the one of the latest StartMeasurement
  bool stopped_ = false;
  Fault fault_;
  std::string cause_;
  std::vector<TrackerReflector> reflectors_;  ///< of the controller, as far as listed
  std::optional<std::int32_t> reflector_in_use_;
  std::optional<std::int32_t> reflector_before_;  ///< before the configured one was set
  std::optional<TrackerOrder> order_;             ///< accepted, not yet reported
  bool order_begun_ = false;
  std::optional<TrackerOrderReport> report_;
};

/// "expected emScon answer, got 48 54 54 50 \"HTTP...\"".
[[nodiscard]] std::string describe(const TrackerProtocolError& nonsense);

}  // namespace abbe::drivers

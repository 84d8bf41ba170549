#pragma once
/// What to ask an emScon controller, and when: the command state machine of a tracker, without its socket.
/// Sans-I/O: one input and the host time in, at most one action out. The order of commands is the one of the
/// manufacturer's manual: status, units, settings, environment, Initialize, reflector, bird bath,
/// coordinates, mode, StartMeasurement. One command at a time. Ordinary world: allocates. One thread.
///
///   Disconnected -> Connecting -> Querying [-> WaitWarm] -> Configuring -> Initialising -> Configuring ->
///   Ready
///     -> Streaming <-> BeamLost;   any -> Stopping -> Disconnected;   any -> Faulted -> Connecting (after a
///     while)
///
/// Disconnected: the connection failed or ended. Faulted: the peer answered, but wrongly, late or with a
/// refusal that waiting does not mend. Both try again, after a pause that doubles from try to try until
/// points come.

#include <chrono>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "abbe/drivers/error.hpp"
#include "abbe/drivers/tracker/receiver.hpp"
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
  std::int32_t packets_per_second = 10;      ///< 3 to 10, what the controller offers; a refusal is no fault
  std::optional<std::int32_t> reflector_id;  ///< none: the one that is set in the controller
  bool go_bird_bath = false;                 ///< not needed with a distance meter (ADM)
  emscon::WeatherMonitor weather = emscon::WeatherMonitor::ReadAndCompute;
  emscon::Environment environment;  ///< Celsius, mbar, percent; told to the controller if `weather` is None

  std::chrono::nanoseconds connect_timeout = std::chrono::seconds{3};
  std::chrono::nanoseconds command_timeout = std::chrono::seconds{3};
  /// The first question of a connection is repeated: who was away hears it as soon as he is back.
  std::chrono::nanoseconds ask_again = std::chrono::milliseconds{250};
  std::chrono::nanoseconds initialize_timeout = std::chrono::seconds{120};     ///< Initialize and GoBirdBath
  std::chrono::nanoseconds silence_timeout = std::chrono::milliseconds{1500};  ///< no packet while streaming
  std::chrono::nanoseconds busy_retry = std::chrono::milliseconds{250};  ///< after "busy" or "not ready"
  std::chrono::nanoseconds busy_patience = std::chrono::seconds{120};    ///< "busy" for longer is a fault
  std::chrono::nanoseconds warm_poll = std::chrono::seconds{5};  ///< how often a heating laser is asked
  std::chrono::nanoseconds resume_within =
      std::chrono::seconds{1};                                    ///< beam back: then StartMeasurement again
  std::chrono::nanoseconds keep_alive = std::chrono::seconds{5};  ///< how often a quiet controller is asked
  std::chrono::nanoseconds first_pause =
      std::chrono::milliseconds{250};  ///< before connecting again, doubled ...
  std::chrono::nanoseconds longest_pause =
      std::chrono::milliseconds{500};  ///< ... up to this: whoever is back streams within a second
};
/// BadConfiguration says which option is out of its range.
[[nodiscard]] Result<void> check(const TrackerSessionOptions& options);

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
    std::variant<TrackerTick, TrackerConnected, TrackerConnectionLost, TrackerPointsArrived, emscon::Answer,
                 emscon::ErrorResponse, emscon::StatusChange, TrackerNonsense, TrackerStopRequested>;

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

 private:
  struct Step {
    TrackerState state{};
    emscon::Request request;
    bool optional = false;  ///< a refusal is taken as done
  };
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
  TrackerAction take(const TrackerNonsense& nonsense);
  TrackerAction take(const TrackerStopRequested&);

  void write_script();
  TrackerAction begin_script();
  TrackerAction next_step();
  TrackerAction send(const Step& step, bool scripted);
  TrackerAction send_again();
  TrackerAction refused(emscon::Status status);
  TrackerAction start_refused();
  TrackerAction done(const emscon::Answer& answer);
  TrackerAction done_without_beam(const emscon::Answer& answer);
  TrackerAction judge(const emscon::SystemStatusAnswer& status);
  void await_answer();
  TrackerAction overdue();
  TrackerAction tick_streaming();
  TrackerAction start_again();
  TrackerAction ask_alive();
  TrackerAction beam_lost();
  void streaming();
  TrackerAction give_up(TrackerState into, const std::string& what);
  [[nodiscard]] bool online() const noexcept;
  [[nodiscard]] std::chrono::nanoseconds time_for(emscon::Command command) const noexcept;
  [[nodiscard]] std::chrono::nanoseconds silence_allowed() const noexcept;

  TrackerSessionOptions options_;
  std::vector<Step> script_;
  TrackerState state_ = TrackerState::Disconnected;
  protocol::HostTime now_{};
  std::size_t step_ = 0;
  std::optional<Pending> pending_;
  protocol::HostTime
      due_{};  ///< of what the state waits for: reconnecting, connection, warm-up, points, keep-alive
  std::chrono::nanoseconds pause_{};
  protocol::HostTime beam_lost_at_{};
  std::optional<protocol::HostTime>
      restart_at_;  ///< the beam is back: StartMeasurement, should no point come before
  bool stopped_ = false;
  Fault fault_;
};

/// "expected emScon answer, got 48 54 54 50 \"HTTP...\"".
[[nodiscard]] std::string describe(const TrackerNonsense& nonsense);

}  // namespace abbe::drivers

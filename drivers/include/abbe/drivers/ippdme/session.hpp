#pragma once
/// State machine of a client of an I++ DME server, without its socket. Sans-I/O: one input and the
/// host time in, at most one action out. One command at a time; the next is sent when the previous
/// one is complete. Not real-time: allocates. One thread. [I++ DME 1.4.3]
///
///   Disconnected -> Connecting -> Opening (StartSession, GetDMEVersion)
///     -> Configuring (IsHomed [Home], SetTool, OnPtMeasReport, OnMoveReportE)
///     -> Ready -> Storing -> Measuring -> Ready
///
///   Storing: the owner stores that a motion is under way; the motion is sent after
///   IppMotionStored. Home, which is sent in Configuring, is stored in the same way.
///
///   any with an unfinished motion -> Aborting (AbortE) -> AwaitingRelease   (for every cause)
///   any -> AwaitingRelease                     (after an error of severity 2 or more)
///   AwaitingRelease -> Clearing (ClearAllErrors) -> Opening, or -> Connecting
///                                              (only by IppReleaseRequested)
///   any -> Stopping -> Disconnected   (lost with an unfinished motion: first one more connection
///                                      for AbortE)
///   any without a motion -> Faulted -> Connecting   (after a pause)
///
/// A connection with an unfinished motion is closed only after AbortE was answered or
/// command_timeout has passed. If such a connection is lost, the next one begins with AbortE,
/// before StartSession, because servers queue commands behind a motion and StartSession clears
/// errors. A session is then started only after a release (IppReleaseRequested). Exception: if the
/// server refuses AbortE outside a session, or does not answer it there, a session is started
/// first.
///
/// While AwaitingRelease, no command is sent that moves the machine or clears an error. Home is
/// sent in the first session and after a release, but not if only the connection was lost.
///
/// While no point is measured, the position is requested once per poll period; this request also
/// checks that the server still answers. Points are accepted in Ready, Storing and Measuring. In
/// any other state they are discarded, which is a fault.

#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "abbe/drivers/deadlines.hpp"
#include "abbe/drivers/error.hpp"
#include "abbe/drivers/ippdme/receiver.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

enum class IppState {
  Disconnected,
  Connecting,
  Opening,
  Configuring,
  Ready,
  Storing,
  Measuring,
  Aborting,
  AwaitingRelease,
  Clearing,
  Stopping,
  Faulted,
};
/// Text for messages: "ready", "measuring", ...
[[nodiscard]] const char* name_of(IppState) noexcept;

/// A target of the machine. If touch: nominal position of the centre of the stylus tip at contact,
/// and the outward surface normal there. The machine moves to this position plus its approach
/// distance along the normal, and probes against the normal.
/// If not touch: an intermediate position. The machine moves there in a straight line without
/// probing. If the server refuses the motion, no later target is begun.
struct ProbePoint {
  std::array<double, 3> position_m{};
  std::array<double, 3> normal = {0.0, 0.0, 1.0};
  bool touch = true;
};

/// Targets that the machine moves to in this order.
using IppPath = std::vector<ProbePoint>;
/// Error BadConfiguration for the first target that I++ DME cannot express: a position or a normal
/// that is not finite or too large. The text names target, coordinate and value.
[[nodiscard]] Result<void> check(std::span<const ProbePoint> path);

/// Outcome of a request to stop the machine.
enum class IppStopOutcome : std::uint8_t {
  None,          ///< no request yet
  Pending,       ///< AbortE is on its way
  Stopped,       ///< AbortE was answered, or no motion was under way
  NotConfirmed,  ///< AbortE was sent, but refused or not answered: the machine may be moving
  NotSent,       ///< there is no connection: the machine may be moving
};
/// Text for messages: "stopped", "not confirmed", ...
[[nodiscard]] const char* name_of(IppStopOutcome) noexcept;

struct IppStop {
  std::uint64_t number = 0;  ///< number of the latest request that the session has received
  IppStopOutcome outcome = IppStopOutcome::None;
  std::string text;  ///< the reason of the outcome, a sentence
};

struct IppSessionOptions {
  std::string peer = "measuring machine";  ///< name in messages: "cmm 10.0.0.9:1294"
  bool home = false;  ///< true: Home is sent if the machine is not homed; false: that is a fault
  std::string held;   ///< reason to await a release from the start; empty: none is awaited
  /// used with `held`: the machine may be moving; its motion is aborted first
  bool moving = false;
  std::string tool;  ///< tool to set before measuring; empty: keep the current tool
  /// Request positions during motions. A refusal of this request with severity 1 is no fault.
  bool move_reports = true;
  std::chrono::nanoseconds poll_period = std::chrono::milliseconds{100};
  std::chrono::nanoseconds connect_timeout = std::chrono::seconds{3};
  std::chrono::nanoseconds command_timeout = std::chrono::seconds{3};
  std::chrono::nanoseconds motion_timeout = std::chrono::seconds{120};  ///< Home, GoTo, PtMeas
  /// Longest time in Storing: a motion that could not be stored by then is not sent.
  std::chrono::nanoseconds store_timeout = std::chrono::seconds{30};
  /// Pause before connecting again; it doubles with each attempt up to longest_pause.
  std::chrono::nanoseconds first_pause = std::chrono::milliseconds{250};
  std::chrono::nanoseconds longest_pause = std::chrono::milliseconds{500};
};
/// Error BadConfiguration; the text names the option that is out of range.
[[nodiscard]] Result<void> check(const IppSessionOptions& options);

struct IppTick {};
struct IppConnected {};
struct IppConnectionLost {
  std::string what;
};
struct IppStopRequested {};  ///< input: ends the session
/// Input: stop a motion, discard all points, and await a release whether or not the machine moved.
struct IppAbortRequested {
  /// Number of the request; returned with the outcome. Requests of several threads may arrive out
  /// of order; the outcome has the highest number.
  std::uint64_t number = 0;
  std::string_view reason = "stopped by request";  ///< reason of the hold; a string literal
};
struct IppReleaseRequested {};  ///< input: an operator has inspected the machine
struct IppMotionStored {};      ///< input in state Storing: the motion may be sent
/// Input in Storing: the motion must not be sent.
struct IppMotionNotStored {
  std::string why;
};
using IppInput =
    std::variant<IppTick, IppConnected, IppConnectionLost, IppStopRequested, IppAbortRequested,
                 IppReleaseRequested, IppMotionStored, IppMotionNotStored, IppPath, IppAck,
                 IppComplete, IppData, IppError, IppProtocolError>;

struct IppNothing {};
/// action: open a connection; the input IppConnected or IppConnectionLost follows
struct IppOpen {};
struct IppClose {};  ///< action: close the connection; no IppConnectionLost follows
struct IppSend {
  std::string line;  ///< command line with its CR LF
};
using IppAction = std::variant<IppNothing, IppOpen, IppClose, IppSend>;

class IppSession {
 public:
  /// Precondition: `options` have passed check().
  explicit IppSession(IppSessionOptions options);

  [[nodiscard]] IppAction on(const IppInput& input, protocol::HostTime now);
  /// The time at which the next IppTick is due.
  [[nodiscard]] protocol::HostTime deadline() const noexcept { return deadlines_.next(); }

  [[nodiscard]] IppState state() const noexcept { return state_; }
  /// True until the machine is released by an operator; also while its motion is still being
  /// stopped.
  [[nodiscard]] bool held() const noexcept { return held_; }
  /// True if IppReleaseRequested has an effect: held, and no motion is still being stopped.
  [[nodiscard]] bool releasable() const noexcept;
  /// The reason why the machine is held; empty if it is not. Later faults do not change the reason.
  [[nodiscard]] const std::string& hold_reason() const noexcept { return hold_reason_; }
  /// True if a motion was sent, on this connection or an earlier one, and its end was not reported.
  [[nodiscard]] bool moving() const noexcept { return moving_; }
  /// True if moving(), or if a motion is sent as soon as this is stored.
  [[nodiscard]] bool may_move() const noexcept { return moving_ || state_ == IppState::Storing; }
  /// True while the session waits for the answer to AbortE, or for a connection or session in which
  /// it will send AbortE.
  [[nodiscard]] bool stopping_motion() const noexcept {
    const bool before_abort = state_ == IppState::Connecting || state_ == IppState::Opening;
    return state_ == IppState::Aborting || (stopped_ && moving_ && before_abort);
  }
  /// The owner no longer waits for the end: an outstanding request to stop counts as failed.
  void give_up_stop();
  /// The latest request to stop and its outcome.
  [[nodiscard]] const IppStop& stop() const noexcept { return stop_; }
  /// The reason why the machine may be moving although the session cannot stop it now; empty if it
  /// cannot be moving.
  [[nodiscard]] std::string danger() const;
  /// Number of requested points that are neither finished nor discarded.
  [[nodiscard]] std::size_t points_left() const noexcept {
    const bool one = state_ == IppState::Measuring || state_ == IppState::Aborting ||
                     (state_ == IppState::Storing && prepared_.state == IppState::Measuring);
    return points_.size() + (one ? 1 : 0);
  }
  struct Fault {
    std::uint64_t count = 0;
    std::string text;
  };
  [[nodiscard]] const Fault& fault() const noexcept { return fault_; }

 private:
  enum class Purpose { Other, Start, Version, IsHomed, Get, Move, Touch, Clear, Watch, End };
  struct Step {
    IppState state;
    std::string method;  ///< method of the command, with its arguments
    Purpose purpose = Purpose::Other;
    bool moves = false;
    std::optional<ippdme::Tag> event = {};  ///< tag of an event; done when acknowledged
  };
  struct Pending {
    Step step;
    ippdme::Tag tag;
    protocol::HostTime sent{};
    bool acknowledged = false;
    std::string data;
    std::optional<IppError> error;
  };

  enum class Due {
    Abort,   ///< answer to AbortE; none by then: the machine may still be moving
    Answer,  ///< no answer to the pending command by then: a fault
    // Purposes that belong to the state: at most one of the following deadlines is set, and none
    // while a command is pending.
    Connect,
    Connection,  ///< no connection by then: a fault
    Store,       ///< the motion is not stored by then: it is not sent
    Poll,        ///< requests the position
    Watch,       ///< checks during a hold that the server still answers
  };

  void write_script();
  [[nodiscard]] IppAction take(const IppTick&);
  [[nodiscard]] IppAction take(const IppConnected&);
  [[nodiscard]] IppAction take(const IppConnectionLost& lost);
  [[nodiscard]] IppAction take(const IppStopRequested&);
  [[nodiscard]] IppAction take(const IppAbortRequested&);
  [[nodiscard]] IppAction take(const IppReleaseRequested&);
  [[nodiscard]] IppAction take(const IppMotionStored&);
  [[nodiscard]] IppAction take(const IppMotionNotStored& failed);
  [[nodiscard]] IppAction take(const IppPath& path);
  [[nodiscard]] IppAction take(const IppAck& ack);
  [[nodiscard]] IppAction take(const IppComplete& complete);
  [[nodiscard]] IppAction take(const IppData& data);
  [[nodiscard]] IppAction take(const IppError& error);
  [[nodiscard]] IppAction take_foreign(const IppError& error);
  [[nodiscard]] IppAction take(const IppProtocolError& malformed);

  [[nodiscard]] bool foreign(ippdme::Tag tag) const noexcept;
  [[nodiscard]] IppAction unexpected_response(std::string_view what, ippdme::Tag tag);
  [[nodiscard]] IppAction send(const Step& step);
  [[nodiscard]] IppAction begin_motion(Step step);
  /// Cancels all deadlines and sets this one.
  void wait_only_for(Due due, protocol::HostTime at);
  void end_pending();
  [[nodiscard]] IppAction unanswered();
  [[nodiscard]] IppAction connect();
  [[nodiscard]] IppAction next_step();
  [[nodiscard]] IppAction done();
  [[nodiscard]] IppAction failed(const Pending& was);
  [[nodiscard]] IppAction ready();
  [[nodiscard]] IppAction check_homed(const std::string& data);
  [[nodiscard]] IppAction give_up(IppState into, const std::string& what);
  [[nodiscard]] IppAction close(IppState into);
  [[nodiscard]] IppAction end_session();
  [[nodiscard]] IppAction hold(const std::string& what);
  [[nodiscard]] IppAction await_release();
  [[nodiscard]] IppAction stop_motion(bool close_then);
  [[nodiscard]] IppAction stop_motion_by_request(std::string_view reason);
  [[nodiscard]] IppAction connect_to_abort();
  [[nodiscard]] IppAction stop_without_connection(std::string_view reason);
  [[nodiscard]] IppAction stopped_moving();
  [[nodiscard]] IppAction abort_unanswered();
  [[nodiscard]] IppAction abort_refused(const IppError& error);
  void hold_for(const std::string& reason);
  void settle(IppStopOutcome outcome, std::string text);
  [[nodiscard]] IppAction began_session();
  void without_move_reports();
  void note(const std::string& what);

  IppSessionOptions options_;
  std::vector<Step> script_;
  std::size_t step_ = 0;
  IppState state_ = IppState::Disconnected;
  protocol::HostTime now_{};
  Deadlines<Due::Watch> deadlines_;
  std::chrono::nanoseconds pause_;
  std::uint32_t tag_ = 0;
  std::optional<Pending> pending_;
  Step prepared_{};  ///< motion that is sent next, in state Storing
  std::deque<ProbePoint> points_;
  bool stopped_ = false;
  bool open_ = false;        ///< the connection is established
  bool in_session_ = false;  ///< StartSession was accepted on this connection
  /// true: a motion was sent, on this connection or one that is lost, and its end was not reported.
  bool moving_ = false;
  /// Close the connection when the motion has stopped. Set after a malformed, unexpected or missing
  /// response: the further content of the connection is not reliable.
  bool close_then_ = false;
  bool held_ = false;  ///< true until the machine is released
  std::string hold_reason_;
  std::string last_note_;     ///< latest fault without the peer and the reason of a hold
  std::string stop_reason_;   ///< last_note_ when AbortE was sent
  std::string asked_reason_;  ///< reason of a request to stop that found no connection; empty: none
  bool session_first_ = false;  ///< start a session before AbortE: the server requires one
  bool may_home_;
  IppStop stop_;
  Fault fault_;
};

}  // namespace abbe::drivers

#pragma once
/// What to ask an I++ DME server, and when: the state machine without its socket. Sans-I/O: one
/// input and the host time in, at most one action out. One command at a time, the next when the one
/// before is complete. Ordinary world: allocates. One thread.
///
///   Disconnected -> Connecting -> Opening (StartSession, GetDMEVersion)
///     -> Configuring (IsHomed [Home], SetTool, OnPtMeasReport, OnMoveReportE) -> Ready <-> Measuring
///   any with an unfinished motion -> Aborting (AbortE) -> AwaitingRelease, whatever the cause
///   any -> AwaitingRelease after an error of severity 2 or more
///   AwaitingRelease -> Clearing (ClearAllErrors) -> Opening, or Connecting, only by IppReleaseRequested
///   any -> Stopping -> Disconnected;   any without a motion -> Faulted -> Connecting (after a while)
///
/// No connection with an unfinished motion is closed before AbortE is answered or command_timeout
/// has passed. When such a connection is lost, the next one begins with AbortE, before
/// StartSession: servers queue commands behind a motion, and StartSession clears errors. A session
/// starts only after a release. Only for a server that refuses AbortE outside a session, or does
/// not answer it, a session is started first. While AwaitingRelease nothing is sent that moves the
/// machine or clears an error. Home is sent in the first session and after a release, never after a
/// mere loss of the connection.
///
/// While nothing is measured the position is asked for every poll period, which also shows that the
/// server lives. Points are taken while Ready or Measuring; in any other state they are forgotten,
/// which is a fault. [I++ DME 1.4.3]

#include <array>
#include <chrono>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

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
  Measuring,
  Aborting,
  AwaitingRelease,
  Clearing,
  Stopping,
  Faulted,
};
/// A literal: "ready", "measuring", ...
[[nodiscard]] const char* name_of(IppState) noexcept;

/// One touch: the nominal place and the outward normal there, of the centre of the tip. The machine
/// moves to the place plus its approach distance along the normal and probes against it. Or a place
/// on the way there: it only moves, straight, and when that is refused nothing that was asked after
/// it is begun.
struct ProbePoint {
  std::array<double, 3> position_m{};
  std::array<double, 3> normal = {0.0, 0.0, 1.0};
  bool touch = true;
};

struct IppSessionOptions {
  std::string peer = "measuring machine";  ///< how messages name it: "cmm 10.0.0.9:1294"
  bool home = false;    ///< may send a machine home that is not; else that is a fault
  std::string held;     ///< not empty: awaits a release from the start, for this reason
  bool moving = false;  ///< with held: a motion may be under way, is aborted first
  std::string tool;     ///< set before measuring; empty: the one that is set
  /// ask for positions while moving; a refusal of severity 1 is no fault
  bool move_reports = true;
  std::chrono::nanoseconds poll_period = std::chrono::milliseconds{100};
  std::chrono::nanoseconds connect_timeout = std::chrono::seconds{3};
  std::chrono::nanoseconds command_timeout = std::chrono::seconds{3};
  std::chrono::nanoseconds motion_timeout = std::chrono::seconds{120};  ///< Home and PtMeas
  /// before connecting again, doubled
  std::chrono::nanoseconds first_pause = std::chrono::milliseconds{250};
  std::chrono::nanoseconds longest_pause = std::chrono::milliseconds{500};  ///< ... up to this
};
/// BadConfiguration says which option is out of its range.
[[nodiscard]] Result<void> check(const IppSessionOptions& options);

struct IppTick {};
struct IppConnected {};
struct IppConnectionLost {
  std::string what;
};
struct IppStopRequested {};  ///< ends the session
struct IppAbortRequested {
};  ///< stops a motion and forgets all points; awaits a release, moving or not
struct IppReleaseRequested {};  ///< by a person who has looked at the machine
using IppInput = std::variant<IppTick, IppConnected, IppConnectionLost, IppStopRequested,
                              IppAbortRequested, IppReleaseRequested, ProbePoint, IppAck,
                              IppComplete, IppData, IppError, IppProtocolError>;

struct IppNothing {};
struct IppOpen {};   ///< open a connection, then say IppConnected or IppConnectionLost
struct IppClose {};  ///< close it; no IppConnectionLost is expected
struct IppSend {
  std::string line;  ///< with its CR LF
};
using IppAction = std::variant<IppNothing, IppOpen, IppClose, IppSend>;

class IppSession {
 public:
  /// `options` have passed check().
  explicit IppSession(IppSessionOptions options);

  [[nodiscard]] IppAction on(const IppInput& input, protocol::HostTime now);
  /// When to say IppTick.
  [[nodiscard]] protocol::HostTime deadline() const noexcept;

  [[nodiscard]] IppState state() const noexcept { return state_; }
  /// Until a person releases the machine; also while its motion is still being stopped.
  [[nodiscard]] bool held() const noexcept { return held_; }
  /// Whether IppReleaseRequested has an effect: held, and its motion is not still being stopped.
  [[nodiscard]] bool releasable() const noexcept;
  /// Why; empty if it is not held. What is refused while it is held does not change it.
  [[nodiscard]] const std::string& hold_reason() const noexcept { return hold_reason_; }
  /// A motion was sent and its end not reported, on this connection or an earlier one.
  [[nodiscard]] bool moving() const noexcept { return moving_; }
  /// Asked for and neither done nor given up.
  [[nodiscard]] std::size_t points_left() const noexcept {
    const bool one = state_ == IppState::Measuring || state_ == IppState::Aborting;
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
    std::string method;  ///< with its arguments
    Purpose purpose = Purpose::Other;
    bool moves = false;
    std::optional<ippdme::Tag> event = {};  ///< its tag; is done when acknowledged
  };
  struct Pending {
    Step step;
    ippdme::Tag tag;
    protocol::HostTime due{};
    bool acknowledged = false;
    std::string data;
    std::optional<IppError> error;
  };

  void write_script();
  [[nodiscard]] IppAction take(const IppTick&);
  [[nodiscard]] IppAction take(const IppConnected&);
  [[nodiscard]] IppAction take(const IppConnectionLost& lost);
  [[nodiscard]] IppAction take(const IppStopRequested&);
  [[nodiscard]] IppAction take(const IppAbortRequested&);
  [[nodiscard]] IppAction take(const IppReleaseRequested&);
  [[nodiscard]] IppAction take(const ProbePoint& point);
  [[nodiscard]] IppAction take(const IppAck& ack);
  [[nodiscard]] IppAction take(const IppComplete& complete);
  [[nodiscard]] IppAction take(const IppData& data);
  [[nodiscard]] IppAction take(const IppError& error);
  [[nodiscard]] IppAction take_foreign(const IppError& error);
  [[nodiscard]] IppAction take(const IppProtocolError& nonsense);

  [[nodiscard]] bool foreign(ippdme::Tag tag) const noexcept;
  [[nodiscard]] IppAction strange(std::string_view what, ippdme::Tag tag);
  [[nodiscard]] IppAction send(const Step& step);
  [[nodiscard]] IppAction connect();
  [[nodiscard]] IppAction next_step();
  [[nodiscard]] IppAction done();
  [[nodiscard]] IppAction failed(const Pending& was);
  [[nodiscard]] IppAction ready();
  [[nodiscard]] IppAction judge_home(const std::string& data);
  [[nodiscard]] IppAction give_up(IppState into, const std::string& what);
  [[nodiscard]] IppAction close(IppState into);
  [[nodiscard]] IppAction goodbye();
  [[nodiscard]] IppAction hold(const std::string& what);
  [[nodiscard]] IppAction await_release();
  [[nodiscard]] IppAction stop_motion(bool close_then);
  [[nodiscard]] IppAction stopped_moving();
  [[nodiscard]] IppAction abort_unanswered();
  [[nodiscard]] IppAction abort_refused(const IppError& error);
  void hold_for(const std::string& reason);
  [[nodiscard]] IppAction began_session();
  void without_move_reports();
  void note(const std::string& what);

  IppSessionOptions options_;
  std::vector<Step> script_;
  std::size_t step_ = 0;
  IppState state_ = IppState::Disconnected;
  protocol::HostTime now_{};
  protocol::HostTime due_{};
  std::chrono::nanoseconds pause_;
  std::uint32_t tag_ = 0;
  std::optional<Pending> pending_;
  std::deque<ProbePoint> points_;
  bool stopped_ = false;
  bool open_ = false;        ///< the connection
  bool in_session_ = false;  ///< StartSession was accepted on it
  /// a motion was asked for and its end not reported, also on a lost connection
  bool moving_ = false;
  /// when the motion has stopped: what comes on this connection is not trusted
  bool close_then_ = false;
  bool held_ = false;  ///< until a person releases the machine
  std::string hold_reason_;
  std::string last_note_;       ///< without the peer and the reason of a hold
  std::string stop_reason_;     ///< last_note_ when AbortE was sent
  bool session_first_ = false;  ///< the server does not abort outside a session
  bool may_home_;
  Fault fault_;
};

}  // namespace abbe::drivers

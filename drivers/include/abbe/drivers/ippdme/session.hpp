#pragma once
/// What to ask an I++ DME server, and when: the state machine without its socket. Sans-I/O: one input and the
/// host time in, at most one action out. One command at a time, the next when the one before is complete.
/// Ordinary world: allocates. One thread.
///
///   Disconnected -> Connecting -> Opening (StartSession, ClearAllErrors, GetDMEVersion)
///     -> Configuring (IsHomed [Home], SetTool, OnPtMeasReport, OnMoveReportE) -> Ready <-> Measuring
///     Ready, Measuring -> Clearing -> Ready after an error that a client can mend
///     any -> Stopping -> Disconnected;   any -> Faulted -> Connecting (after a while)
///
/// While nothing is measured the position is asked for every poll period, which also shows that the server
/// lives. Points are taken while Ready, Measuring or Clearing; in any other state they are forgotten, which
/// is a fault. [I++ DME 1.4.3]

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
  Clearing,
  Stopping,
  Faulted,
};
/// A literal: "ready", "measuring", ...
[[nodiscard]] const char* name_of(IppState) noexcept;

/// One touch: the nominal place and the outward normal there, of the centre of the tip. The machine moves to
/// the place plus its approach distance along the normal and probes against it. Or a place on the way there:
/// it only moves, straight, and when that is refused nothing that was asked after it is begun.
struct ProbePoint {
  std::array<double, 3> position_m{};
  std::array<double, 3> normal = {0.0, 0.0, 1.0};
  bool touch = true;
};

struct IppSessionOptions {
  std::string peer = "measuring machine";  ///< how messages name it: "cmm 10.0.0.9:1294"
  bool home = false;                       ///< may send a machine home that is not; else that is a fault
  std::string tool;                        ///< set before measuring; empty: the one that is set
  bool move_reports = true;                ///< ask for positions while moving; a refusal is no fault
  std::chrono::nanoseconds poll_period = std::chrono::milliseconds{100};
  std::chrono::nanoseconds connect_timeout = std::chrono::seconds{3};
  std::chrono::nanoseconds command_timeout = std::chrono::seconds{3};
  std::chrono::nanoseconds motion_timeout = std::chrono::seconds{120};  ///< Home and PtMeas
  std::chrono::nanoseconds first_pause =
      std::chrono::milliseconds{250};  ///< before connecting again, doubled
  std::chrono::nanoseconds longest_pause = std::chrono::milliseconds{500};  ///< ... up to this
};
/// BadConfiguration says which option is out of its range.
[[nodiscard]] Result<void> check(const IppSessionOptions& options);

struct IppTick {};
struct IppConnected {};
struct IppConnectionLost {
  std::string what;
};
struct IppStopRequested {};
using IppInput = std::variant<IppTick, IppConnected, IppConnectionLost, IppStopRequested, ProbePoint, IppAck,
                              IppComplete, IppData, IppError, IppNonsense>;

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
  /// Asked for and neither done nor given up.
  [[nodiscard]] std::size_t points_left() const noexcept {
    return points_.size() + (state_ == IppState::Measuring ? 1 : 0);
  }
  struct Fault {
    std::uint64_t count = 0;
    std::string text;
  };
  [[nodiscard]] const Fault& fault() const noexcept { return fault_; }

 private:
  enum class Purpose { Other, Version, IsHomed, Get, Move, Touch, Clear, End };
  struct Step {
    IppState state;
    std::string method;  ///< with its arguments
    Purpose purpose = Purpose::Other;
    bool optional = false;
    bool moves = false;
    bool event = false;  ///< is done when acknowledged
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
  [[nodiscard]] IppAction take(const ProbePoint& point);
  [[nodiscard]] IppAction take(const IppAck& ack);
  [[nodiscard]] IppAction take(const IppComplete& complete);
  [[nodiscard]] IppAction take(const IppData& data);
  [[nodiscard]] IppAction take(const IppError& error);
  [[nodiscard]] IppAction take(const IppNonsense& nonsense);

  [[nodiscard]] bool online() const noexcept;
  [[nodiscard]] bool foreign(ippdme::Tag tag) const noexcept;
  [[nodiscard]] IppAction strange(std::string_view what, ippdme::Tag tag);
  [[nodiscard]] IppAction send(const Step& step);
  [[nodiscard]] IppAction next_step();
  [[nodiscard]] IppAction done();
  [[nodiscard]] IppAction failed(const Pending& was);
  [[nodiscard]] IppAction ready();
  [[nodiscard]] IppAction judge_home(const std::string& data);
  [[nodiscard]] IppAction give_up(IppState into, const std::string& what);
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
  Fault fault_;
};

}  // namespace abbe::drivers

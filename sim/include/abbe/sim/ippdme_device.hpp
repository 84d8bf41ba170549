#pragma once
/// An I++ DME server in front of a simulated measuring machine, without its socket: bytes and a
/// time in, bytes out. It has the preconditions of a real server (a session, a homed machine, an
/// existing tool) and reports errors with the numbers of the specification. Commands are executed
/// one after the other, events at once. Not thread-safe. [I++ DME 1.4.3]
///
/// Our choices where the specification leaves the behaviour open: A touch reports the centre of the
/// tip, and its data line is sent after the machine has retracted. If the connection closes during
/// a motion, the machine completes the motion (`keeps_moving`); the commands of the next
/// connection, including StartSession, wait until the machine has stopped. A client must handle
/// this.

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/protocol/ippdme/lines.hpp"
#include "abbe/sim/fault.hpp"
#include "abbe/sim/measuring_machine.hpp"
#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

namespace ippdme = protocol::ippdme;

struct IppDmeOptions {
  MeasuringMachine machine;
  bool homed = true;
  std::vector<std::string> tools = {"ruby 4"};
  double travel_speed_m_s = 0.2;
  double probing_speed_m_s = 5e-3;
  std::chrono::nanoseconds home_time = std::chrono::seconds{2};
  bool speaks_move_reports = true;
  bool keeps_moving = true;  ///< when the connection closes, a motion continues
  bool answers_aborts = true;
  bool aborts_outside_session = true;  ///< false: AbortE outside a session is an error
  bool refuses_aborts = false;         ///< answers AbortE with error 0500 and continues the motion
};

class IppDmeDevice {
 public:
  /// The server is switched on at `now`.
  IppDmeDevice(const IppDmeOptions& options, HostTime now);

  void connected(HostTime now);
  void disconnected();
  void receive(std::span<const std::byte> bytes, HostTime now);
  /// Executes everything that is due until `now`, in order of time.
  void advance(HostTime now);
  [[nodiscard]] HostTime next_due() const;

  /// Bytes for the client that were made since the last call.
  [[nodiscard]] std::vector<std::byte> take_output();
  [[nodiscard]] bool wants_close() const { return wants_close_; }
  [[nodiscard]] bool accepts() const { return true; }

  void inject(const Fault& fault, HostTime now);
  /// Replaces the artefact on the table, as an operator would do.
  void put_on_table(const MeasuringMachine& machine) { options_.machine = machine; }

  /// Presses the emergency stop: the motion ends and an unsolicited error is sent. Errors cannot be
  /// cleared before the button is released at `pulled_out_at`.
  void press_emergency_stop(HostTime now, HostTime pulled_out_at);
  /// The operator touches by hand: reports an unsolicited touch at this scale reading.
  void touch_by_hand(const Eigen::Vector3d& reading_m);

  [[nodiscard]] bool in_session() const { return session_; }
  [[nodiscard]] bool moving() const { return motion_.has_value(); }
  /// The received commands without tags, e.g. "PtMeas(X(1),Y(2),Z(3))": the latest kMostHeard of
  /// all connections.
  static constexpr std::size_t kMostHeard = 4096;
  [[nodiscard]] const std::deque<std::string>& heard() const { return heard_; }
  [[nodiscard]] std::uint64_t touches() const { return touches_; }
  /// The scale readings, m.
  [[nodiscard]] Eigen::Vector3d reading_m(HostTime now) const;

 private:
  struct Command {
    ippdme::Tag tag;
    std::string method;
    std::string arguments;
  };
  /// A motion from one position to another, and the report at its end.
  struct Motion {
    Command command;
    Eigen::Vector3d from_m;
    Eigen::Vector3d to_m;
    HostTime begin;
    HostTime end;
    std::optional<Probing> probing;
    bool homing = false;
    bool client_gone = false;  ///< the connection that sent the command is closed
  };
  struct MoveReport {
    ippdme::Tag tag;
    std::vector<std::string> names;
    std::chrono::nanoseconds period;
    HostTime next;
  };

  void on_line(std::string_view line, HostTime now);
  void on_event(const Command& command, HostTime now);
  void begin_next(HostTime now);
  void carry_out(const Command& command, HostTime now);
  [[nodiscard]] bool carry_out_session(const Command& command);
  [[nodiscard]] bool carry_out_tools(const Command& command);
  [[nodiscard]] bool carry_out_motion(const Command& command, HostTime now);
  [[nodiscard]] bool carry_out_reports(const Command& command, HostTime now);
  void begin_motion(const Command& command, const Eigen::Vector3d& to_m, double extra_s,
                    HostTime now);
  void begin_touch(const Command& command, HostTime now);
  void end_motion();
  void abort(HostTime now);
  void report_error(int severity);

  void send_line(std::string_view line);
  void acknowledge(ippdme::Tag tag) { send_line(ippdme::to_string(tag) + " &"); }
  void complete(ippdme::Tag tag) { send_line(ippdme::to_string(tag) + " %"); }
  void data(ippdme::Tag tag, std::string_view text) {
    send_line(ippdme::to_string(tag) + " # " + std::string(text));
  }
  void fault(const Command& command, int severity, int code, std::string_view text);
  [[nodiscard]] std::string place(const std::vector<std::string>& names,
                                  const Eigen::Vector3d& p_m) const;

  IppDmeOptions options_;
  std::unique_ptr<ippdme::LineFramer> framer_ = std::make_unique<ippdme::LineFramer>();
  std::vector<std::byte> out_;
  bool session_ = false;
  bool homed_;
  bool failed_ = false;  ///< an error of severity 2 or more, until ClearAllErrors
  std::string tool_;
  std::deque<Command> queue_;
  std::optional<Motion> motion_;
  std::optional<MoveReport> move_report_;
  std::vector<std::string> touch_report_ = {"X", "Y", "Z"};
  Eigen::Vector3d position_m_ = Eigen::Vector3d::Zero();
  std::uint64_t touches_ = 0;
  HostTime mute_until_ = HostTime::min();
  HostTime emergency_until_ = HostTime::min();
  std::deque<std::string> heard_;
  int refuse_touch_ = 0;  ///< error of the next touch; 0: none
  int refuse_way_ = 0;    ///< error of the next GoTo; 0: none
  bool wants_close_ = false;
};

}  // namespace abbe::sim

#pragma once
/// One CANopen encoder: the server side of CiA 301 and CiA 406 around an object dictionary,
/// measuring one axis of the virtual machine; a single-turn encoder on a rotary axis. Sans-I/O:
/// frames and a time in, frames with their send time out. The node sends the *scale reading* at the
/// instant a SYNC arrives. Faults can be injected. Not thread-safe.

#include <cstdint>
#include <optional>
#include <vector>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/object_dictionary.hpp"
#include "abbe/protocol/can/sdo_server.hpp"
#include "abbe/sim/measured_axis.hpp"
#include "abbe/sim/virtual_machine.hpp"

namespace abbe::sim {

namespace can = protocol::can;

struct EncoderNodeOptions {
  can::NodeId node = 1;
  MeasuredAxis axis = Axis::X;
  std::uint32_t step_nm = 10;                    ///< linear
  std::uint32_t units_per_revolution = 1 << 20;  ///< rotary; the counts are 0 to one less than this
  double offset = 0.0;                           ///< the reading at count 0, m or rad
  bool invert = false;                           ///< counts fall as the reading rises
  /// standard deviation of one reading before it is rounded to counts, m or rad
  double noise = 5e-9;
  std::uint64_t seed = 1;
  /// time from reset to the boot-up message
  std::chrono::nanoseconds boot_time = std::chrono::milliseconds{200};
  /// The machine's control has configured the node: after its boot-up message it sends heartbeats
  /// and answers every SYNC.
  bool configured = false;
};

struct TimedFrame {
  HostTime due{};
  can::CanFrame frame;
};

class EncoderNode {
 public:
  /// Powers on at `now`: the boot-up message is due at once. `machine` must outlive the node.
  EncoderNode(const EncoderNodeOptions& options, const VirtualMachine& machine, HostTime now);
  // not copyable, because its SDO server refers to its dictionary
  EncoderNode(const EncoderNode&) = delete;
  EncoderNode& operator=(const EncoderNode&) = delete;

  void on_frame(const can::CanFrame& frame, HostTime at);
  /// Does what is due until `now`: heartbeats, event timers, the end of a restart.
  void advance(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  /// Frames that the node has made since the last call.
  [[nodiscard]] std::vector<TimedFrame> take_frames();

  // Fault injection.
  void mute_until(HostTime until) { mute_until_ = until; }
  /// Until the instant `until`, every frame is sent later than normal by `delay`.
  void delay_until(HostTime until, std::chrono::nanoseconds delay);
  void restart(HostTime now);  ///< restarts the node, as after a power cut
  void emergency(std::uint16_t code, std::uint8_t error_register, HostTime now);

  [[nodiscard]] can::NodeId node() const { return options_.node; }
  /// BootUp: the node sends and answers nothing until its boot time is over.
  [[nodiscard]] can::NodeState state() const { return state_; }
  [[nodiscard]] const can::ObjectDictionary& objects() const { return objects_; }

 private:
  void on_nmt(const can::NmtMessage& message, HostTime at);
  void on_sync(HostTime at);
  void boot(HostTime at, bool reset_objects);
  void configure();
  void sample(HostTime at);
  void send(const can::CanFrame& frame, HostTime at);
  [[nodiscard]] std::chrono::nanoseconds heartbeat_period() const;

  EncoderNodeOptions options_;
  const VirtualMachine& machine_;
  can::ObjectDictionary objects_;
  can::SdoServer sdo_;
  can::NodeState state_ = can::NodeState::BootUp;
  std::vector<TimedFrame> out_;
  HostTime boot_at_;
  HostTime last_heartbeat_;
  std::array<HostTime, 2> last_event_{};
  std::array<std::uint8_t, 2> syncs_seen_{};
  std::uint64_t readings_ = 0;
  HostTime mute_until_ = HostTime::min();
  HostTime delay_until_ = HostTime::min();
  std::chrono::nanoseconds delay_{};
};

}  // namespace abbe::sim

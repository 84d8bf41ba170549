#pragma once
/// [encoder]: CANopen encoders on one bus. Pure data.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "abbe/drivers/axis_kind.hpp"

namespace abbe::daemon {

struct ConfigKind;

enum class EncoderTransport { Udp, SocketCan };
/// The producer of the SYNC messages. Daemon: the device thread of abbed. Kernel: the timer of the
/// kernel's CAN_BCM sockets. External: the machine; abbed then sends nothing on the bus.
enum class SyncConfig { Daemon, Kernel, External };

/// One element of [encoder] nodes, with
///
///   reading = offset + count * step
///
/// `invert = true` in the file makes the step negative.
struct EncoderNodeConfig {
  std::string axis;
  std::uint8_t node = 0;  ///< CANopen node id, 1 to 127
  double step = 1e-9;     ///< m or rad per count, signed
  double offset = 0.0;    ///< reading at count 0, m or rad
  drivers::AxisKind kind = drivers::AxisKind::Linear;
  int tpdo = 1;  ///< 1 or 2: the TPDO with the position
  /// byte in the TPDO at which the position begins; for External only, else read from the node
  int position_byte = 0;
  /// Rotary: counts per revolution, after which the count wraps to 0. 0: read from the node.
  std::int64_t wrap_counts = 0;
  std::optional<double> middle;  ///< rotary axis: middle of its travel, rad
};

struct EncoderConfig {
  static const ConfigKind kKind;
  std::string name = "encoder";
  EncoderTransport transport = EncoderTransport::SocketCan;
  std::string interface;         ///< SocketCAN only, "can0"
  std::uint16_t local_port = 0;  ///< UDP only; 0: the kernel chooses
  std::string peer_host;         ///< UDP only
  std::uint16_t peer_port = 0;   ///< UDP only
  SyncConfig sync = SyncConfig::Daemon;
  std::chrono::nanoseconds sync_period{std::chrono::milliseconds{1}};
  /// Time from the SYNC (on CAN: the reception of its echo; on UDP: its sending) to the instant at
  /// which the node latches its position.
  std::chrono::nanoseconds sampling_delay{};
  /// Standard uncertainty of sampling_delay; 0 only with simulated devices.
  std::chrono::nanoseconds u_sampling_delay = std::chrono::microseconds{50};
  /// True: the control already corrects these readings. Then no model becomes ACTIVE and none can
  /// be identified, because a model would correct the same errors a second time.
  bool axes_compensated = false;
  /// The nodes in the order of MachineConfig::axes; contains X, Y and Z.
  std::vector<EncoderNodeConfig> nodes;
};

}  // namespace abbe::daemon

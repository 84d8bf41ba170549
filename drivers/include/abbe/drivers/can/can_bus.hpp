#pragma once
/// Interface of the CAN transports: frames in with their arrival times, frames out. Makes system
/// calls: not for the RT path; one thread. SocketCanBus is a CAN interface of Linux, UdpCanBus a
/// tunnel or the simulator.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "abbe/drivers/error.hpp"
#include "abbe/protocol/can/frame.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

namespace can = protocol::can;

struct ReceivedFrame {
  can::CanFrame frame;
  protocol::HostTime time{};  ///< arrival; of an echo: transmission
  /// true: there is no usable kernel timestamp, and `time` was read when the frame reached user
  /// space.
  bool time_widened = false;
  /// The frame is our own SYNC (sent by start_sync() or, with echoes_sync(), by send()), received
  /// back when it was transmitted.
  bool echo = false;
};

/// Numbers of losses and refusals since construction.
struct CanBusCounters {
  std::uint64_t lost = 0;               ///< the kernel's queue was full, or datagrams are missing
  std::uint64_t refused = 0;            ///< datagrams that contain no valid CAN frames
  std::uint64_t time_widened = 0;       ///< arrivals without a usable kernel timestamp
  std::uint64_t foreign_datagrams = 0;  ///< refused datagrams of senders other than the peer
};

/// Result of read(). The transport filters frames out, so fewer frames than out.size() do not mean
/// that the receive queue is empty. `all` states whether it was read to its end.
struct CanRead {
  std::size_t frames = 0;
  bool all = false;  ///< the receive queue was read to its end
  /// Time at which read() began to take frames from the queue, after its wait: if `all`, every
  /// frame that arrived before `until` was delivered.
  protocol::HostTime until{};
};

class CanBus {
 public:
  static constexpr std::size_t kMostRead = 256;

  CanBus() = default;
  CanBus(const CanBus&) = delete;
  CanBus& operator=(const CanBus&) = delete;
  virtual ~CanBus() = default;

  /// Opens the transport; closes it first if it is open. read() delivers frames with these 11-bit
  /// identifiers and all error frames, no others.
  [[nodiscard]] virtual Result<void> open(std::span<const std::uint32_t> ids) = 0;
  virtual void close() noexcept = 0;
  /// Waits at most `wall` (time of the operating system; 0: does not wait) and reads the frames
  /// that have arrived, at most out.size(), which must not exceed kMostRead. Frames that the kernel
  /// dropped are replaced by one error frame ReceiveOverflow. Error code Unreachable: the peer does
  /// not answer at present, the bus stays open; after any other code: close and open again.
  [[nodiscard]] virtual Result<CanRead> read(std::span<ReceivedFrame> out,
                                             std::chrono::nanoseconds wall) = 0;
  /// Errors as for read().
  [[nodiscard]] virtual Result<void> send(std::span<const can::CanFrame> frames) = 0;
  /// From now on the operating system sends the SYNC every `period`, independently of this thread,
  /// until stop_sync() or close(). read() delivers each SYNC as an echo if its identifier was
  /// passed to open(). Error BadConfiguration if the transport has no cyclic transmission.
  [[nodiscard]] virtual Result<void> start_sync(std::chrono::nanoseconds period);
  virtual void stop_sync() noexcept {}
  [[nodiscard]] virtual bool has_sync() const noexcept { return false; }
  /// True if read() delivers a SYNC of send() as an echo after its transmission (provided that its
  /// identifier was passed to open()).
  [[nodiscard]] virtual bool echoes_sync() const noexcept { return false; }
  [[nodiscard]] virtual CanBusCounters counters() const noexcept = 0;
  /// Sender of the latest datagram that did not come from the peer, "127.0.0.1:4711"; empty: none.
  [[nodiscard]] virtual std::string foreign_sender() const { return {}; }
  /// Name of the bus for messages: "can0", "udp 127.0.0.1:20000".
  [[nodiscard]] virtual std::string name() const = 0;
};

}  // namespace abbe::drivers

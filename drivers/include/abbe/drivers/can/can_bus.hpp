#pragma once
/// The seam for CAN transports: frames in with the time they arrived, frames out. Ordinary world
/// (system calls); one thread. SocketCanBus is the real bus, UdpCanBus the tunnel and the
/// simulator.

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
  protocol::HostTime time{};  ///< arrival; of an echo: when it left
  /// the kernel stamp was not believed: `time` is when user space saw it
  bool time_widened = false;
  /// our own SYNC (start_sync() or, with echoes_sync(), send()), heard back as it left
  bool echo = false;
};

/// What a transport lost or refused since it was made; never goes back.
struct CanBusCounters {
  std::uint64_t lost = 0;     ///< the kernel's queue was full, or datagrams missing in the sequence
  std::uint64_t refused = 0;  ///< datagrams that are no CAN frames
  std::uint64_t time_widened = 0;  ///< arrivals whose kernel stamp could not be used
  std::uint64_t strangers = 0;     ///< datagrams of others than the peer: refused
};

/// What read() gave. The bus may have looked at more frames than it hands on: `frames` alone says
/// nothing of what else is there.
struct CanRead {
  std::size_t frames = 0;
  bool all = false;  ///< nothing else was there
  protocol::HostTime
      /// after the wait, before the first look: what came before this is among them, if `all`
      until{};
};

class CanBus {
 public:
  static constexpr std::size_t kMostRead = 256;

  CanBus() = default;
  CanBus(const CanBus&) = delete;
  CanBus& operator=(const CanBus&) = delete;
  virtual ~CanBus() = default;

  /// Opens, or closes and opens again, for these 11-bit identifiers and all error frames; others
  /// are not delivered.
  [[nodiscard]] virtual Result<void> open(std::span<const std::uint32_t> ids) = 0;
  virtual void close() noexcept = 0;
  /// Waits at most `wall` (the operating system's time, 0 = look only) and reads what is there, at
  /// most out.size(), itself at most kMostRead. Where the kernel had no room for frames, an error
  /// frame ReceiveOverflow stands in their place. Error code Unreachable: nobody there now, the bus
  /// stays open; any other code: close and open again.
  [[nodiscard]] virtual Result<CanRead> read(std::span<ReceivedFrame> out,
                                             std::chrono::nanoseconds wall) = 0;
  /// Errors as for read().
  [[nodiscard]] virtual Result<void> send(std::span<const can::CanFrame> frames) = 0;
  /// Lets the operating system send the SYNC every `period` from now on, whatever this thread does,
  /// until stop_sync() or close(). read() gives each as an echo, if its identifier was among those
  /// of open(). BadConfiguration if this transport cannot.
  [[nodiscard]] virtual Result<void> start_sync(std::chrono::nanoseconds period);
  virtual void stop_sync() noexcept {}
  [[nodiscard]] virtual bool has_sync() const noexcept { return false; }
  /// read() also gives a SYNC of send() as an echo when it has left, if its identifier was among
  /// those of open().
  [[nodiscard]] virtual bool echoes_sync() const noexcept { return false; }
  [[nodiscard]] virtual CanBusCounters counters() const noexcept = 0;
  /// Where the latest stranger's datagram came from: "127.0.0.1:4711"; empty: there was none.
  [[nodiscard]] virtual std::string stranger() const { return {}; }
  /// For people: "can0", "udp 127.0.0.1:20000".
  [[nodiscard]] virtual std::string name() const = 0;
};

}  // namespace abbe::drivers

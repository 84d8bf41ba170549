#pragma once
/// A CAN interface of Linux: a SocketCAN RAW socket, filtered to the identifiers in use, with error
/// frames, kernel receive timestamps and the kernel's loss counter. A second socket (CAN_BCM) sends
/// the cyclic SYNC from the kernel's timer. Bit rate and restart-ms are set on the interface with
/// `ip link`, not here.

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "abbe/drivers/can/can_bus.hpp"
#include "abbe/drivers/kernel_stamp.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::drivers {

struct SocketCanOptions {
  std::string interface = "can0";
  /// Requested size of the socket's receive queue; without CAP_NET_ADMIN the kernel limits it to
  /// net.core.rmem_max (by default about 500 frames).
  int receive_buffer_bytes = 1 << 20;
  /// true: an interface without CAN FD is refused. On an interface with CAN FD, FD frames are read
  /// with either value.
  bool require_fd = false;
  double speed = 1.0;  ///< same as UdpCanOptions::speed
};

class SocketCanBus final : public CanBus {
 public:
  /// `time` must outlive the bus.
  SocketCanBus(SocketCanOptions options, const TimeSource& time);
  ~SocketCanBus() override;

  [[nodiscard]] Result<void> open(std::span<const std::uint32_t> ids) override;
  void close() noexcept override;
  [[nodiscard]] Result<CanRead> read(std::span<ReceivedFrame> out,
                                     std::chrono::nanoseconds wall) override;
  [[nodiscard]] Result<void> send(std::span<const can::CanFrame> frames) override;
  [[nodiscard]] Result<void> start_sync(std::chrono::nanoseconds period) override;
  void stop_sync() noexcept override;
  [[nodiscard]] bool has_sync() const noexcept override { return true; }
  [[nodiscard]] bool echoes_sync() const noexcept override { return true; }
  [[nodiscard]] CanBusCounters counters() const noexcept override;
  [[nodiscard]] std::string name() const override { return options_.interface; }

 private:
  struct Batch;  ///< buffers for recvmmsg
  [[nodiscard]] Result<void> configure(std::span<const std::uint32_t> ids);
  [[nodiscard]] Result<int> find_interface() const;
  [[nodiscard]] Result<void> bind_to_interface(int index);

  SocketCanOptions options_;
  const TimeSource& time_;
  int fd_ = -1;
  int sync_fd_ = -1;  ///< CAN_BCM socket; closing it ends the SYNC
  /// start_sync() was called since open(): SYNCs of the kernel may still arrive after a stop
  bool kernel_sent_ = false;
  bool sent_sync_ = false;  ///< send() has sent a SYNC since open()
  /// true: an earlier socket of this object has sent a SYNC that may still arrive. Therefore a SYNC
  /// from this computer that is not an echo of the open socket is ignored.
  bool left_over_ = false;
  KernelStampMap stamps_;
  std::unique_ptr<Batch> batch_;
  std::optional<ReceivedFrame> held_;  ///< frame for which `out` had no space beside a loss mark
  std::uint64_t lost_ = 0;
  std::uint32_t last_overflow_ = 0;  ///< value of SO_RXQ_OVFL, which counts per socket
};

}  // namespace abbe::drivers

#pragma once
/// The real bus: a Linux SocketCAN RAW socket, filtered to the identifiers in use, with error
/// frames, kernel receive stamps and the kernel's own loss counter; a BCM socket beside it sends
/// the cyclic SYNC from the kernel's timer. Bit rate and restart-ms belong to the interface (ip
/// link), not to us.

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
  /// Asked for; without CAP_NET_ADMIN the kernel gives net.core.rmem_max at most (by default some
  /// 500 frames).
  int receive_buffer_bytes = 1 << 20;
  bool require_fd =
      /// refuse an interface that carries no CAN FD; where it does, FD frames are read anyway
      false;
  double speed = 1.0;  ///< as UdpCanOptions::speed
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
  struct Batch;  ///< the buffers of recvmmsg
  [[nodiscard]] Result<void> configure(std::span<const std::uint32_t> ids);
  [[nodiscard]] Result<int> find_interface() const;
  [[nodiscard]] Result<void> bind_to_interface(int index);

  SocketCanOptions options_;
  const TimeSource& time_;
  int fd_ = -1;
  int sync_fd_ = -1;          ///< CAN_BCM; closing it ends the SYNC
  bool kernel_sent_ = false;  ///< since open(): what was on its way when it ended is ours, too
  bool sent_sync_ = false;    ///< since open()
  /// A socket closed before sent a SYNC: one of this computer that is no echo may be its, still on
  /// the way.
  bool left_over_ = false;
  KernelStampMap stamps_;
  std::unique_ptr<Batch> batch_;
  std::optional<ReceivedFrame> held_;  ///< found no room beside the mark of a loss
  std::uint64_t lost_ = 0;
  std::uint32_t last_overflow_ = 0;  ///< SO_RXQ_OVFL counts per socket
};

}  // namespace abbe::drivers

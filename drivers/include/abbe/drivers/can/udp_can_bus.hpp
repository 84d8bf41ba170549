#pragma once
/// CAN over UDP with the framing of protocol/can/udp_framing.hpp. Peers are the cannelloni tunnel,
/// gateways and abbe-sim. All frames of a datagram have the arrival time of the datagram. A tunnel
/// that buffers delays this time; the time of a position is not affected, it comes from the SYNC.

#include <netinet/in.h>

#include <array>
#include <bitset>
#include <cstdint>
#include <optional>
#include <string>

#include "abbe/drivers/can/can_bus.hpp"
#include "abbe/drivers/kernel_stamp.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/protocol/can/udp_framing.hpp"

namespace abbe::drivers {

struct UdpCanOptions {
  /// The address of this computer on which datagrams are received; the default means every network
  /// interface. With any address, only datagrams from the peer's address and port are accepted.
  std::string local_address = "0.0.0.0";
  std::uint16_t local_port = 0;            ///< 0: the kernel chooses, see local_port()
  std::string peer_address = "127.0.0.1";  ///< IPv4 address, or a name that open() resolves
  std::uint16_t peer_port = 20000;
  /// Speed of the TimeSource: host time per monotonic time. 0: the host time is advanced in steps
  /// by the caller, and kernel timestamps are not used.
  double speed = 1.0;
};

class UdpCanBus final : public CanBus {
 public:
  /// `time` must outlive the bus.
  UdpCanBus(UdpCanOptions options, const TimeSource& time);
  ~UdpCanBus() override;

  [[nodiscard]] Result<void> open(std::span<const std::uint32_t> ids) override;
  void close() noexcept override;
  [[nodiscard]] Result<CanRead> read(std::span<ReceivedFrame> out,
                                     std::chrono::nanoseconds wall) override;
  [[nodiscard]] Result<void> send(std::span<const can::CanFrame> frames) override;
  [[nodiscard]] CanBusCounters counters() const noexcept override;
  [[nodiscard]] std::string foreign_sender() const override { return stranger_; }
  [[nodiscard]] std::string name() const override;

  /// Bound port; 0 while closed.
  [[nodiscard]] std::uint16_t local_port() const noexcept { return bound_port_; }

 private:
  [[nodiscard]] Result<void> bind_and_connect(const sockaddr_in& local, const sockaddr_in& peer);
  void listen_for_strangers(sockaddr_in local);
  void count_strangers();
  void count_stranger(const sockaddr_in& from);
  [[nodiscard]] bool is_peer(const sockaddr_in& from) const;
  enum class Next : std::uint8_t { Datagram, Nothing, Unknown };
  [[nodiscard]] Result<Next> receive_datagram();
  std::size_t take_frames(std::span<ReceivedFrame> out);
  [[nodiscard]] Result<void> send_datagram(std::span<const std::byte> datagram);

  UdpCanOptions options_;
  const TimeSource& time_;
  int fd_ = -1;
  /// Second socket, bound to the same port but not connected: it receives the datagrams of all
  /// senders other than the peer.
  int stranger_fd_ = -1;
  sockaddr_in peer_{};
  std::uint64_t strangers_ = 0;
  std::string stranger_;
  std::uint16_t bound_port_ = 0;
  std::bitset<can::CanFrame::kStandardMask + 1> wanted_;
  KernelStampMap stamps_;
  can::SequenceGaps gaps_;
  std::uint64_t refused_ = 0;
  std::uint8_t sequence_ = 0;
  std::optional<can::DatagramView> rest_;  ///< frames in `buffer_` that read() has not returned
  Arrival rest_arrival_;
  std::array<std::byte, 65536> buffer_{};
};

}  // namespace abbe::drivers

#include "abbe/sim/control_port.hpp"

#include <sys/socket.h>

#include <array>

#include "abbe/result/try.hpp"

namespace abbe::sim {

Result<ControlPort> ControlPort::open(std::uint16_t port) {
  auto socket = bind_udp(port);
  ABBE_TRY(socket);
  // The buffer is large enough for the records of a second, which a sender that was stopped sends
  // at once.
  constexpr int kBytes = 1 << 20;
  ::setsockopt(socket->get(), SOL_SOCKET, SO_RCVBUF, &kBytes, sizeof kBytes);
  return ControlPort(std::move(*socket));
}

void ControlPort::poll(HostTime now) {
  // limit, so that a sender that never pauses does not block the simulation
  constexpr int kMost = 1000;
  // One byte more than a record, so that a longer datagram is not taken for one.
  std::array<std::byte, protocol::kPositionRecordBytes + 1> buffer{};
  for (int i = 0; i < kMost; ++i) {
    const ssize_t size = ::recv(socket_.get(), buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (size < 0) return;
    const auto record =
        protocol::decode_position_record(std::span(buffer).first(static_cast<std::size_t>(size)));
    if (record) {
      motion_->add(*record, now, i == 0);
    } else {
      ++not_records_;
    }
  }
}

}  // namespace abbe::sim

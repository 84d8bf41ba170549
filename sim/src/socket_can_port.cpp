#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "can_port.hpp"

namespace abbe::sim {
namespace {

constexpr int kMostFrames = 1024;

can::CanFrame from_linux(const can_frame& frame) {
  can::CanFrame out;
  if ((frame.can_id & CAN_EFF_FLAG) != 0) out.set(can::FrameFlag::Extended);
  if ((frame.can_id & CAN_RTR_FLAG) != 0) out.set(can::FrameFlag::Remote);
  out.id = frame.can_id & (out.is(can::FrameFlag::Extended) ? CAN_EFF_MASK : CAN_SFF_MASK);
  out.length = std::min<std::uint8_t>(frame.can_dlc, can::CanFrame::kMaxClassicData);
  std::memcpy(out.data.data(), frame.data, out.payload().size());
  return out;
}

can_frame to_linux(const can::CanFrame& frame) {
  can_frame out{};
  out.can_id = frame.id;
  if (frame.is(can::FrameFlag::Extended)) out.can_id |= CAN_EFF_FLAG;
  if (frame.is(can::FrameFlag::Remote)) out.can_id |= CAN_RTR_FLAG;
  if (frame.is(can::FrameFlag::Error)) out.can_id |= CAN_ERR_FLAG;
  out.can_dlc = std::min<std::uint8_t>(frame.length, can::CanFrame::kMaxClassicData);
  std::memcpy(out.data, frame.data.data(), out.can_dlc);
  return out;
}

class SocketCanPort final : public CanPort {
 public:
  SocketCanPort(Socket socket, double speed) : socket_(std::move(socket)), age_(socket_, speed) {}

  std::span<const ArrivedFrame> receive() override {
    arrived_.clear();
    for (int i = 0; i < kMostFrames && receive_frame(); ++i) {
    }
    return arrived_;
  }

  void send(std::span<const can::CanFrame> frames) override {
    for (const auto& frame : frames) {
      const can_frame out = to_linux(frame);
      // If the queue is full the frame is lost, as in the transmit buffer of a real node.
      [[maybe_unused]] const auto sent = ::write(socket_.get(), &out, sizeof out);
    }
  }

  void send_garbage() override {
    auto foreign = can::standard_frame(0x181, {0xff, 0xff, 0x00, 0x13, 0x37, 0x02, 0x00});
    foreign.set(can::FrameFlag::Extended);
    const std::array frames{foreign, can::standard_frame(0x181, {0xff})};
    send(frames);
  }

  [[nodiscard]] bool has_listener() const override { return true; }
  [[nodiscard]] int fd() const override { return socket_.get(); }

 private:
  bool receive_frame() {
    can_frame frame{};
    iovec part{&frame, sizeof frame};
    alignas(cmsghdr) std::array<char, 64> control{};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t size = ::recvmsg(socket_.get(), &message, MSG_DONTWAIT);

    // ENETDOWN is reported once when the interface goes down; the socket receives again when it is
    // up.
    if (size < 0) return errno == ENETDOWN;
    if (size == static_cast<ssize_t>(CAN_MTU))
      arrived_.push_back({from_linux(frame), age_.of(message)});

    return true;
  }

  Socket socket_;
  MessageAge age_;
  std::vector<ArrivedFrame> arrived_;
};

}  // namespace

Result<std::unique_ptr<CanPort>> open_socket_can_port(const CanPortOptions& options) {
  const auto refused = [&](const char* what) {
    return io_error(fmt::format("CAN {}: {}: {}", options.interface, what, std::strerror(errno)));
  };

  Socket socket(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
  if (!socket) return refused("cannot open a socket");
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(options.interface.c_str()));
  if (address.can_ifindex == 0) return refused("cannot find the interface");

  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return refused("cannot bind");
  }

  return std::make_unique<SocketCanPort>(std::move(socket), options.speed);
}

}  // namespace abbe::sim

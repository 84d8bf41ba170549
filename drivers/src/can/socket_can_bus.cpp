#include "abbe/drivers/can/socket_can_bus.hpp"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <unistd.h>

#include <array>

#include "abbe/drivers/can/linux_frame.hpp"
#include "can/socket_io.hpp"

namespace abbe::drivers {

namespace {
constexpr unsigned kSlots = 64;
constexpr std::size_t kControlBytes = 256;
}  // namespace

struct SocketCanBus::Batch {
  std::array<canfd_frame, kSlots> frames{};
  std::array<iovec, kSlots> io{};
  std::array<mmsghdr, kSlots> messages{};
  alignas(cmsghdr) std::array<std::array<char, kControlBytes>, kSlots> control{};

  void prepare() {
    for (unsigned i = 0; i < kSlots; ++i) {
      io[i] = {&frames[i], sizeof frames[i]};
      messages[i] = {};
      messages[i].msg_hdr.msg_iov = &io[i];
      messages[i].msg_hdr.msg_iovlen = 1;
      messages[i].msg_hdr.msg_control = control[i].data();
      messages[i].msg_hdr.msg_controllen = control[i].size();
    }
  }
};

SocketCanBus::SocketCanBus(SocketCanOptions options, const TimeSource& time)
    : options_(std::move(options)), time_(time), batch_(std::make_unique<Batch>()) {}

SocketCanBus::~SocketCanBus() {
  close();
}

CanBusCounters SocketCanBus::counters() const noexcept {
  return {lost_, 0, stamps_.widened()};
}

void SocketCanBus::close() noexcept {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
  last_overflow_ = 0;
}

Result<void> SocketCanBus::open(std::span<const std::uint32_t> ids) {
  close();
  stamps_.nothing_older_than(read_clock_pair());
  fd_ = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (fd_ < 0) return socket_error(ErrorCode::SystemRefused, name(), "socket", errno);
  auto ok = configure(ids);
  if (ok) ok = bind_to_interface();
  if (!ok) close();
  return ok;
}

Result<void> SocketCanBus::configure(std::span<const std::uint32_t> ids) {
  const auto filters = filters_for(ids);
  const auto bytes = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
  if (setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), bytes) != 0) {
    return socket_error(ErrorCode::SystemRefused, name(), "set the receive filter", errno);
  }
  const can_err_mask_t errors = CAN_ERR_MASK;
  if (setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) != 0) {
    return socket_error(ErrorCode::SystemRefused, name(), "ask for error frames", errno);
  }
  const int on = 1;
  // Not every interface does CAN FD and not everybody may enlarge the buffer: both are welcome, neither is
  // needed.
  setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
  setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &options_.receive_buffer_bytes,
             sizeof options_.receive_buffer_bytes);
  setsockopt(fd_, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
  enable_stamps(fd_);
  return {};
}

Result<void> SocketCanBus::bind_to_interface() {
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(options_.interface.c_str()));
  if (address.can_ifindex == 0)
    return socket_error(ErrorCode::SystemRefused, name(), "find the interface", errno);
  const auto* any = reinterpret_cast<const sockaddr*>(&address);  // NOLINT: the sockets interface
  if (bind(fd_, any, sizeof address) != 0)
    return socket_error(ErrorCode::SystemRefused, name(), "bind", errno);
  return {};
}

Result<std::size_t> SocketCanBus::read(std::span<ReceivedFrame> out, std::chrono::nanoseconds wall) {
  wait_readable(fd_, wall);
  batch_->prepare();
  const auto begun = read_clock_pair();
  const auto slots = static_cast<unsigned>(std::min<std::size_t>(kSlots, out.size()));
  const int got = recvmmsg(fd_, batch_->messages.data(), slots, MSG_DONTWAIT, nullptr);
  if (got < 0) {
    if (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)
      return socket_error(ErrorCode::SystemRefused, name(), "receive", errno);  // ENETDOWN: it went down
    stamps_.nothing_older_than(begun);
    return 0;
  }
  const auto clocks = read_clock_pair();
  const auto now = time_.now();
  std::size_t count = 0;
  for (unsigned i = 0; i < static_cast<unsigned>(got); ++i) {
    auto& message = batch_->messages[i];
    const auto arrival = stamps_.arrival(stamp_of(message.msg_hdr), clocks, now);
    out[count].time = arrival.time;
    out[count].time_widened = arrival.widened;
    for (auto* c = CMSG_FIRSTHDR(&message.msg_hdr); c != nullptr; c = CMSG_NXTHDR(&message.msg_hdr, c)) {
      if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SO_RXQ_OVFL) continue;
      std::uint32_t overflow = 0;  // cumulative for this socket
      std::memcpy(&overflow, CMSG_DATA(c), sizeof overflow);
      lost_ += overflow - last_overflow_;
      last_overflow_ = overflow;
    }
    if (const auto frame = from_linux(batch_->frames[i], message.msg_len)) out[count++].frame = *frame;
  }
  if (static_cast<unsigned>(got) < slots) stamps_.nothing_older_than(begun);
  return count;
}

Result<void> SocketCanBus::send(std::span<const can::CanFrame> frames) {
  for (const auto& frame : frames) {
    const auto out = to_linux(frame);
    if (write(fd_, &out.frame, out.size) >= 0) continue;
    // A full transmit queue empties by itself, or the bus is off and an error frame says so.
    const bool passing = errno == ENOBUFS || errno == EAGAIN;
    return socket_error(passing ? ErrorCode::Unreachable : ErrorCode::SystemRefused, name(), "send", errno);
  }
  return {};
}

}  // namespace abbe::drivers

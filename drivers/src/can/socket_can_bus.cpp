#include "abbe/drivers/can/socket_can_bus.hpp"

#include <linux/can.h>
#include <linux/can/bcm.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <utility>

#include "abbe/drivers/can/linux_frame.hpp"
#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/error_frame.hpp"
#include "abbe/result/try.hpp"
#include "can/socket_io.hpp"

namespace abbe::drivers {

using protocol::HostTime;

namespace {
constexpr unsigned kSlots = CanBus::kMostRead;
constexpr std::size_t kControlBytes = 256;

/// Frame that marks a loss, counted by SO_RXQ_OVFL, at its place among the received frames. A CAN
/// controller reports an overflow of its receive queue with the same error frame.
can::CanFrame loss_mark() {
  return can::encode_error_frame(
      {.conditions = static_cast<can::BusConditions>(can::BusCondition::ReceiveOverflow)});
}
}  // namespace

struct SocketCanBus::Batch {
  std::array<canfd_frame, kSlots> frames{};
  std::array<iovec, kSlots> io{};
  std::array<mmsghdr, kSlots> messages{};
  alignas(cmsghdr) std::array<std::array<char, kControlBytes>, kSlots> control{};
  unsigned used = kSlots;  ///< slots that must be initialised before the next recvmmsg

  void prepare() {
    for (unsigned i = 0; i < used; ++i) {
      io[i] = {&frames[i], sizeof frames[i]};
      messages[i] = {};
      messages[i].msg_hdr.msg_iov = &io[i];
      messages[i].msg_hdr.msg_iovlen = 1;
      messages[i].msg_hdr.msg_control = control[i].data();
      messages[i].msg_hdr.msg_controllen = control[i].size();
    }
    used = 0;
  }
};

SocketCanBus::SocketCanBus(SocketCanOptions options, const TimeSource& time)
    : options_(std::move(options)),
      time_(time),
      stamps_(options_.speed),
      batch_(std::make_unique<Batch>()) {}

SocketCanBus::~SocketCanBus() {
  close();
}

CanBusCounters SocketCanBus::counters() const noexcept {
  return {lost_, 0, stamps_.widened()};
}

void SocketCanBus::close() noexcept {
  stop_sync();
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
  left_over_ = left_over_ || sent_sync_ || kernel_sent_;
  sent_sync_ = kernel_sent_ = false;
  last_overflow_ = 0;
  held_.reset();
}

Result<void> SocketCanBus::open(std::span<const std::uint32_t> ids) {
  close();
  stamps_.nothing_older_than(read_clock_pair());
  fd_ = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (fd_ < 0) return socket_error(ErrorCode::SystemRefused, name(), "socket", errno);
  auto ok = configure(ids);
  if (ok) ok = find_interface().and_then([this](int index) { return bind_to_interface(index); });
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
    return socket_error(ErrorCode::SystemRefused, name(), "enable error frames", errno);
  }

  const int on = 1;
  // The result of this call is not used: find_interface() checks whether the interface has CAN FD.
  setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);

  if (setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &on, sizeof on) != 0) {
    return socket_error(ErrorCode::SystemRefused, name(), "enable the echo of sent frames", errno);
  }

  const int bytes_wanted = options_.receive_buffer_bytes;
  if (setsockopt(fd_, SOL_SOCKET, SO_RCVBUFFORCE, &bytes_wanted, sizeof bytes_wanted) != 0) {
    setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &bytes_wanted, sizeof bytes_wanted);
  }

  setsockopt(fd_, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
  enable_stamps(fd_);
  return {};
}

/// Index of the interface. Error if it does not exist, is down, or lacks the required CAN FD.
Result<int> SocketCanBus::find_interface() const {
  ifreq request{};
  options_.interface.copy(request.ifr_name, IFNAMSIZ - 1);
  const auto ask = [&](unsigned long what) { return ioctl(fd_, what, &request) == 0; };

  const auto no = [&](std::string_view what, int error) {
    return socket_error(ErrorCode::SystemRefused, name(), what, error);
  };

  if (!ask(SIOCGIFINDEX)) return no("find the interface", errno);
  const int index = request.ifr_ifindex;
  if (!ask(SIOCGIFFLAGS)) return no("query the interface", errno);
  if ((request.ifr_flags & IFF_UP) == 0) return no("open (ip link set up)", ENETDOWN);
  if (!ask(SIOCGIFMTU)) return no("query the interface", errno);

  if (options_.require_fd && request.ifr_mtu < static_cast<int>(CANFD_MTU)) {
    return tl::unexpected(
        Error{ErrorCode::BadConfiguration,
              fmt::format("CAN {}: CAN FD is required, but the interface supports classic CAN only",
                          name())});
  }

  return index;
}

Result<void> SocketCanBus::bind_to_interface(int index) {
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = index;
  const auto* any = reinterpret_cast<const sockaddr*>(&address);  // NOLINT: the sockets interface
  if (bind(fd_, any, sizeof address) != 0)
    return socket_error(ErrorCode::SystemRefused, name(), "bind", errno);
  return {};
}

Result<CanRead> SocketCanBus::read(std::span<ReceivedFrame> out, std::chrono::nanoseconds wall) {
  if (!held_) wait_readable(fd_, wall);
  batch_->prepare();
  const auto until = time_.now();
  const auto begun = read_clock_pair();
  std::size_t count = 0;
  if (held_) out[count++] = *std::exchange(held_, std::nullopt);
  const auto slots = static_cast<unsigned>(std::min<std::size_t>(kSlots, out.size() - count));
  const int got = recvmmsg(fd_, batch_->messages.data(), slots, MSG_DONTWAIT, nullptr);

  if (got < 0) {
    if (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)
      return socket_error(ErrorCode::SystemRefused, name(), "receive",
                          errno);  // ENETDOWN: the interface is down
    if (errno == EINTR) return CanRead{.frames = count, .until = until};
    stamps_.nothing_older_than(begun);
    return CanRead{.frames = count, .all = true, .until = until};
  }

  batch_->used = static_cast<unsigned>(got);
  const auto clocks = read_clock_pair();
  const auto now = options_.speed > 0.0 ? HostTime{time_.host(clocks.monotonic)} : time_.now();
  bool marked = false;

  for (unsigned i = 0; i < static_cast<unsigned>(got); ++i) {
    auto& message = batch_->messages[i];
    const auto arrival = options_.speed > 0.0
                             ? stamps_.arrival(stamp_of(message.msg_hdr), clocks, now)
                             : Arrival{.time = now};
    ReceivedFrame received{.time = arrival.time, .time_widened = arrival.widened};
    for (auto* c = CMSG_FIRSTHDR(&message.msg_hdr); c != nullptr;
         c = CMSG_NXTHDR(&message.msg_hdr, c)) {
      if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SO_RXQ_OVFL) continue;
      std::uint32_t overflow = 0;  // cumulative for this socket
      std::memcpy(&overflow, CMSG_DATA(c), sizeof overflow);
      if (overflow == last_overflow_) continue;
      lost_ += overflow - last_overflow_;
      last_overflow_ = overflow;
      if (!std::exchange(marked, true)) out[count++] = {.frame = loss_mark(), .time = arrival.time};
    }
    const auto frame = from_linux(batch_->frames[i], message.msg_len);
    if (!frame) continue;
    // The kernel sets MSG_CONFIRM if this socket sent the frame, MSG_DONTROUTE if this computer did
    // [Linux, networking/can].
    const bool by_us = (message.msg_hdr.msg_flags & MSG_CONFIRM) != 0;
    const bool from_here = (message.msg_hdr.msg_flags & MSG_DONTROUTE) != 0;
    const bool by_the_kernel = kernel_sent_ && from_here;
    const bool sync = can::decode_sync(*frame).has_value();
    received.echo = (by_us || by_the_kernel) && sync;
    if (by_us && !received.echo) continue;
    if (left_over_ && from_here && sync && !received.echo) continue;
    received.frame = *frame;
    if (count < out.size()) {
      out[count++] = received;
    } else {
      held_ = received;
    }
  }

  // recvmmsg filled fewer slots than it was given: the end of the queue was reached. A slot counts
  // as filled also if its frame is not delivered to the caller.
  const bool at_end = static_cast<unsigned>(got) < slots;
  if (at_end) stamps_.nothing_older_than(begun);
  return CanRead{.frames = count, .all = at_end && !held_, .until = until};
}

Result<void> SocketCanBus::send(std::span<const can::CanFrame> frames) {
  for (const auto& frame : frames) {
    sent_sync_ = sent_sync_ || can::decode_sync(frame).has_value();
    const auto out = to_linux(frame);
    if (write(fd_, &out.frame, out.size) >= 0) continue;
    // These two errors are not fatal: a full transmit queue empties again; bus-off is reported by
    // an error frame.
    const bool passing = errno == ENOBUFS || errno == EAGAIN;
    return socket_error(passing ? ErrorCode::Unreachable : ErrorCode::SystemRefused, name(), "send",
                        errno);
  }
  return {};
}

Result<void> SocketCanBus::start_sync(std::chrono::nanoseconds period) {
  stop_sync();
  const auto no = [this](std::string_view what) {
    auto error = socket_error(ErrorCode::SystemRefused, name(), what, errno);
    stop_sync();
    return error;
  };
  const auto index = find_interface();
  ABBE_TRY(index);
  sync_fd_ = socket(PF_CAN, SOCK_DGRAM | SOCK_CLOEXEC, CAN_BCM);
  if (sync_fd_ < 0) return no("socket of the broadcast manager");
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = *index;
  const auto* any = reinterpret_cast<const sockaddr*>(&address);  // NOLINT: the sockets interface
  if (connect(sync_fd_, any, sizeof address) != 0) return no("connect the broadcast manager");

  const auto sync = to_linux(can::encode_sync());
  bcm_msg_head head;  // ends in a flexible array: clang rejects its initialisation
  std::memset(&head, 0, sizeof head);
  head.opcode = TX_SETUP;
  head.flags = SETTIMER | STARTTIMER;
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(time_.wall(period)).count();
  head.ival2 = {us / 1'000'000, us % 1'000'000};
  head.can_id = sync.frame.can_id;
  head.nframes = 1;
  // The frames follow the head in the same write; a classic frame is the first CAN_MTU bytes.
  std::array<std::byte, sizeof head + CAN_MTU> job{};
  std::memcpy(job.data(), &head, sizeof head);
  std::memcpy(job.data() + sizeof head, &sync.frame, CAN_MTU);
  if (write(sync_fd_, job.data(), job.size()) != static_cast<ssize_t>(job.size()))
    return no("start the SYNC");
  kernel_sent_ = true;
  return {};
}

void SocketCanBus::stop_sync() noexcept {
  if (sync_fd_ >= 0) ::close(sync_fd_);
  sync_fd_ = -1;
}

}  // namespace abbe::drivers

#include "can_port.hpp"

#include <cstring>
#include <ctime>

#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

Result<std::unique_ptr<CanPort>> CanPort::open(const CanPortOptions& options) {
  return options.interface.empty() ? open_udp_port(options) : open_socket_can_port(options);
}

MessageAge::MessageAge(const Socket& socket, double speed) : speed_(speed) {
  const int on = 1;
  if (speed > 0.0) setsockopt(socket.get(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
}

std::chrono::nanoseconds MessageAge::of(const msghdr& message) const {
  for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr;
       c = CMSG_NXTHDR(const_cast<msghdr*>(&message), c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPNS) continue;
    timespec stamp{};
    timespec now{};
    std::memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
    clock_gettime(CLOCK_REALTIME, &now);
    const std::chrono::nanoseconds age{(now.tv_sec - stamp.tv_sec) * 1'000'000'000 + now.tv_nsec -
                                       stamp.tv_nsec};
    if (age.count() >= 0 && age < std::chrono::seconds{1})
      return seconds_to_ns(speed_ * ns_to_seconds(age));
  }

  return {};
}

}  // namespace abbe::sim

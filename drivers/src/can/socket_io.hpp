#pragma once
/// What the two socket transports share: waiting, stamps, error texts.

#include <fmt/format.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/drivers/error.hpp"

namespace abbe::drivers {

inline tl::unexpected<Error> socket_error(ErrorCode code, std::string_view bus,
                                          std::string_view what, int error) {
  return tl::unexpected(
      Error{code, fmt::format("CAN {}: {}: {}", bus, what, std::strerror(error))});
}

/// Waits until there is something to read or `wall` has passed.
inline void wait_readable(int fd, std::chrono::nanoseconds wall) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  const auto ns = std::max<std::int64_t>(wall.count(), 0);
  const timespec timeout{static_cast<time_t>(ns / kSecond), static_cast<long>(ns % kSecond)};
  pollfd poll{fd, POLLIN, 0};
  ppoll(&poll, 1, &timeout, nullptr);  // an interrupted wait is a short wait
}

/// Asks for receive stamps of the kernel and, where there are any, of the hardware. The hardware's
/// clock is another one and is not used yet. The kernel begins to stamp a little later, when a
/// worker of its own has switched it on; frames that come before have no stamp. A refusal is no
/// error: the user-space time, widened, remains.
inline void enable_stamps(int fd) {
  const int flags = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
  setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPING, &flags, sizeof flags);
}

/// The software stamp among the control messages.
inline std::optional<std::chrono::nanoseconds> stamp_of(msghdr& message) {
  for (auto* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPING) continue;
    scm_timestamping stamps{};
    std::memcpy(&stamps, CMSG_DATA(c), sizeof stamps);
    if (stamps.ts[0].tv_sec == 0 && stamps.ts[0].tv_nsec == 0) return std::nullopt;
    return std::chrono::seconds{stamps.ts[0].tv_sec} +
           std::chrono::nanoseconds{stamps.ts[0].tv_nsec};
  }
  return std::nullopt;
}

}  // namespace abbe::drivers

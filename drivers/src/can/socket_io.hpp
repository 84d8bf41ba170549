#pragma once
/// Shared by the two socket transports: waiting, kernel timestamps, error texts.

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

/// Waits until `fd` is readable, at most `wall`.
inline void wait_readable(int fd, std::chrono::nanoseconds wall) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  const auto ns = std::max<std::int64_t>(wall.count(), 0);
  const timespec timeout{static_cast<time_t>(ns / kSecond), static_cast<long>(ns % kSecond)};
  pollfd poll{fd, POLLIN, 0};
  ppoll(&poll, 1, &timeout, nullptr);  // if a signal interrupts the wait, it returns early
}

/// Enables software receive timestamps. Hardware timestamps are not used: they come from another
/// clock. A kernel worker enables timestamping a little later; frames that arrive before that have
/// no timestamp. A failure is not reported: then the user-space time is used, with widened
/// uncertainty.
inline void enable_stamps(int fd) {
  const int flags = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
  setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPING, &flags, sizeof flags);
}

/// The software timestamp in the control messages; nullopt: none.
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

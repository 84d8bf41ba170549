#include "abbe/drivers/emergency_stop.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <time.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>

namespace abbe::drivers {
namespace {

// Memory of fixed size, because a signal handler reads it.
std::array<std::atomic<EmergencyStop*>, kMostEmergencyStops> registered_stops{};
// Number of running calls of send_emergency_stops(). This counter, the registered objects and their
// sockets are accessed with sequential consistency. Thus either the call sees that the object or
// socket is gone, or await_senders() sees the call.
std::atomic<int> senders{0};

void await_senders() noexcept {
  constexpr timespec kPause{.tv_sec = 0, .tv_nsec = 100'000};
  while (senders.load() > 0) ::nanosleep(&kPause, nullptr);
}

std::int64_t monotonic_ms() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);  // async-signal-safe [signal-safety(7)]
  return std::int64_t{now.tv_sec} * 1000 + now.tv_nsec / 1'000'000;
}

bool send_whole(int fd, std::string_view bytes) noexcept {
  const auto sent = ::send(fd, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  return sent == static_cast<ssize_t>(bytes.size());
}

}  // namespace

EmergencyStop::EmergencyStop(std::string_view command, std::string_view confirmation) noexcept
    : command_(command), confirmation_(confirmation) {
  for (auto& place : registered_stops) {
    EmergencyStop* empty = nullptr;
    if (place.compare_exchange_strong(empty, this)) return;
  }
}

EmergencyStop::~EmergencyStop() {
  for (auto& place : registered_stops) {
    EmergencyStop* self = this;
    place.compare_exchange_strong(self, nullptr);
  }
  await_senders();
}

void EmergencyStop::set_socket(int fd) noexcept {
  const int before = socket_.exchange(fd);
  if (before >= 0 && before != fd) await_senders();
}

/// Reads until the confirmation was received. It may arrive in pieces, so the end of the bytes read
/// before is kept.
bool EmergencyStop::confirmed(int fd, std::chrono::milliseconds within) const noexcept {
  std::array<char, 512> bytes;  // NOLINT(cppcoreguidelines-pro-type-member-init): recv() fills it
  std::size_t kept = 0;
  const std::int64_t until = monotonic_ms() + within.count();
  for (std::int64_t left = within.count(); left > 0; left = until - monotonic_ms()) {
    pollfd readable{fd, POLLIN, 0};
    if (::poll(&readable, 1, static_cast<int>(left)) <= 0) continue;
    const ssize_t n = ::recv(fd, bytes.data() + kept, bytes.size() - kept, MSG_DONTWAIT);
    if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) return false;
    if (n < 0) continue;

    const std::string_view seen{bytes.data(), kept + static_cast<std::size_t>(n)};
    if (seen.find(confirmation_) != std::string_view::npos) return true;
    kept = std::min(seen.size(), confirmation_.size() - 1);
    std::copy(seen.end() - static_cast<std::ptrdiff_t>(kept), seen.end(), bytes.begin());
  }
  return false;
}

EmergencyStops send_emergency_stops(std::chrono::milliseconds within) noexcept {
  struct Sent {
    const EmergencyStop* to = nullptr;
    int fd = -1;
  };
  std::array<Sent, kMostEmergencyStops> sent{};
  EmergencyStops done;
  senders.fetch_add(1);

  // All commands are sent first; only then the confirmations are read, so that no machine waits for
  // another.
  for (const auto& place : registered_stops) {
    const EmergencyStop* const stop = place.load();
    if (stop == nullptr || !stop->moving_.load(std::memory_order_acquire)) continue;
    const int fd = stop->socket_.load();
    if (fd >= 0 && send_whole(fd, stop->command_))
      sent[static_cast<std::size_t>(done.sent++)] = {stop, fd};
    else
      ++done.not_sent;
  }

  for (int i = 0; i < done.sent; ++i) {
    const auto& [to, fd] = sent[static_cast<std::size_t>(i)];
    if (to->confirmed(fd, within)) ++done.confirmed;
  }
  senders.fetch_sub(1);
  return done;
}

}  // namespace abbe::drivers

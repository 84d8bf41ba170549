#include "accept_loop.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <exception>
#include <utility>

#include "internal_error.hpp"

namespace abbe::web {
namespace {

constexpr int kCycle_ms = 1000;
constexpr int kPauseAfterError_ms = 200;  ///< for example until a file descriptor is free again
constexpr std::chrono::seconds kLongestCycle{10};

/// Errors of the socket itself. All others are of one connection or pass (accept(2)).
bool ends_listening(int error) {
  return error == EBADF || error == EINVAL || error == ENOTSOCK || error == EFAULT;
}

/// The client has left, or there is nothing to accept.
bool is_usual(int error) {
  return error == EAGAIN || error == EINTR || error == ECONNABORTED || error == EPROTO;
}

}  // namespace

AcceptLoop::AcceptLoop(int listener, Take take, Report report)
    : listener_(listener),
      take_(std::move(take)),
      report_(std::move(report)),
      wake_(::eventfd(0, EFD_CLOEXEC)) {
  (void)::fcntl(listener_, F_SETFL, ::fcntl(listener_, F_GETFL) | O_NONBLOCK);
  thread_ = std::thread([this] { run(); });
}

AcceptLoop::~AcceptLoop() {
  stopping_ = true;
  const std::uint64_t one = 1;
  (void)!::write(wake_.get(), &one, sizeof one);
  thread_.join();
}

std::string AcceptLoop::fault(Clock::time_point now) const {
  {
    const std::lock_guard lock(mutex_);
    if (!fault_.empty()) return fault_;
  }
  const auto since = now - cycled_.load();
  if (since < kLongestCycle) return {};
  return fmt::format("no connection has been accepted for {} s: the thread is blocked",
                     std::chrono::duration_cast<std::chrono::seconds>(since).count());
}

void AcceptLoop::run() {
  while (!stopping_ && !ended_) {
    cycled_ = Clock::now();
    try {
      cycle();
    } catch (const std::exception& error) {
      report_internal_error([this](const std::string& line) { report_("accept", line); },
                            error.what(), "a connection is closed");
    }
  }
}

void AcceptLoop::cycle() {
  std::array<pollfd, 2> waits{pollfd{listener_, POLLIN, 0}, pollfd{wake_.get(), POLLIN, 0}};
  const int ready = ::poll(waits.data(), waits.size(), kCycle_ms);
  if (ready == 0) set_fault({});  // the clients of the last error have left
  if (ready < 0) return wait_failed(errno);
  if (ready == 0 || waits[0].revents == 0) return;

  daemon::FileDescriptor fd{::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK)};
  if (!fd) return accept_failed(errno);
  set_fault({});
  take_(std::move(fd));
}

void AcceptLoop::accept_failed(int error) {
  if (is_usual(error)) return;
  const bool ends = ends_listening(error);
  std::string fault = fmt::format("connections cannot be accepted: {}{}", std::strerror(error),
                                  ends ? "" : ": trying again");
  report_fault(std::move(fault));
  ended_ = ends;
  pollfd wake{wake_.get(), POLLIN, 0};
  if (!ends) (void)::poll(&wake, 1, kPauseAfterError_ms);
}

/// poll() itself fails, for example without memory in the kernel: the pause is a sleep.
void AcceptLoop::wait_failed(int error) {
  if (error == EINTR) return;
  std::this_thread::sleep_for(std::chrono::milliseconds{kPauseAfterError_ms});
  report_fault(fmt::format("connections cannot be waited for: poll: {}: trying again",
                           std::strerror(error)));
}

void AcceptLoop::report_fault(std::string fault) {
  report_("accept", fault);
  set_fault(std::move(fault));
}

void AcceptLoop::set_fault(std::string fault) {
  const std::lock_guard lock(mutex_);
  fault_ = std::move(fault);
}

}  // namespace abbe::web

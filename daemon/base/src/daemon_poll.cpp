#include "abbe/base/daemon_poll.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cstdint>
#include <exception>
#include <string>
#include <utility>

#include "abbe/base/control_protocol.hpp"

namespace abbe::daemon {
namespace {

// This is longer than the hub's longest cycle under load, and shorter than two heartbeats of
// MTConnect.
constexpr std::chrono::seconds kStatusTimeOut{2};

DaemonPoll::Answer ask_for_status(const std::filesystem::path& socket) {
  try {
    return ask_daemon(socket, {{"do", "status"}}, kStatusTimeOut);
  } catch (const std::exception& error) {
    return fail(ErrorCode::Io, std::string{"ask abbed: "} + error.what());
  }
}

}  // namespace

DaemonPoll::DaemonPoll(std::filesystem::path control_socket, std::chrono::milliseconds period)
    : socket_(std::move(control_socket)),
      period_(period),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      thread_([this] { run(); }) {}

DaemonPoll::~DaemonPoll() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stop_requested_.notify_one();
  thread_.join();
}

std::optional<DaemonPoll::Answer> DaemonPoll::take() {
  std::uint64_t count = 0;
  (void)!::read(wake_.get(), &count, sizeof count);
  const std::lock_guard lock(mutex_);
  return std::exchange(answer_, std::nullopt);
}

void DaemonPoll::run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    Answer answer = ask_for_status(socket_);
    lock.lock();

    answer_ = std::move(answer);
    const std::uint64_t one = 1;
    (void)!::write(wake_.get(), &one, sizeof one);
    stop_requested_.wait_for(lock, period_, [this] { return stopping_; });
  }
}

}  // namespace abbe::daemon

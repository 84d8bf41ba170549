#pragma once
/// Wakes one waiting thread. signal() takes no lock and never blocks, so that a real-time thread
/// may wake a thread without real-time priority.

#include <semaphore.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <ctime>

namespace abbe::daemon {

class WakeUp {
 public:
  WakeUp() noexcept { ::sem_init(&semaphore_, 0, 0); }
  WakeUp(const WakeUp&) = delete;
  WakeUp& operator=(const WakeUp&) = delete;
  ~WakeUp() { ::sem_destroy(&semaphore_); }

  /// May be called from any thread. Signals are counted: each signal lets one wait return.
  void signal() noexcept {
    signals_.fetch_add(1, std::memory_order_release);
    ::sem_post(&semaphore_);
  }
  void wait() noexcept {
    while (::sem_wait(&semaphore_) != 0) {  // EINTR: wait again
    }
    order_memory();
  }
  /// True if a signal came within `at_most`; one signal is then consumed.
  bool wait_for(std::chrono::nanoseconds at_most) noexcept {
    const auto until = (std::chrono::steady_clock::now() + at_most).time_since_epoch();
    const auto seconds = std::chrono::floor<std::chrono::seconds>(until);
    const timespec at{.tv_sec = seconds.count(),
                      .tv_nsec = std::chrono::nanoseconds{until - seconds}.count()};
    int failed = 0;
    do failed = ::sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &at);
    while (failed != 0 && errno == EINTR);
    if (failed == 0) order_memory();
    return failed == 0;
  }

 private:
  /// The acquire load pairs with the release in signal(). The semaphore orders memory as well, but
  /// ThreadSanitizer of GCC 12 does not support sem_clockwait.
  void order_memory() const noexcept { (void)signals_.load(std::memory_order_acquire); }

  std::atomic<unsigned> signals_{0};
  sem_t semaphore_{};
};

}  // namespace abbe::daemon

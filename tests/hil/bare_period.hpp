#pragma once
/// A thread that does nothing but wake every millisecond, before everything measured: how often the
/// computer itself is late. What such a thread loses no driver can keep.

#include <pthread.h>
#include <sys/prctl.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <ctime>
#include <thread>

namespace abbe::tests {

class BarePeriod {
 public:
  static constexpr std::chrono::nanoseconds kPeriod = std::chrono::milliseconds{1};
  /// When a cycle of encoders is closed.
  static constexpr std::chrono::nanoseconds kLate = kPeriod * 4 / 5;

  /// `priority`: SCHED_FIFO; 0: ordinary.
  explicit BarePeriod(int priority) : thread_([this, priority] { run(priority); }) {}
  ~BarePeriod() { stop(); }
  BarePeriod(const BarePeriod&) = delete;
  BarePeriod& operator=(const BarePeriod&) = delete;

  void stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  /// After stop(): periods, and those of them that began more than kLate late or were slept
  /// through.
  [[nodiscard]] std::size_t periods() const { return periods_; }
  [[nodiscard]] std::size_t late() const { return late_; }

 private:
  void run(int priority) {
    ::prctl(PR_SET_TIMERSLACK, 1UL);
    const sched_param param{.sched_priority = priority};
    if (priority != 0) ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &param);
    for (auto due = std::chrono::steady_clock::now() + kPeriod; !stop_; due += kPeriod) {
      const auto ns = due.time_since_epoch().count();  // steady_clock is CLOCK_MONOTONIC
      const timespec at{.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
      ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
      ++periods_;
      if (std::chrono::steady_clock::now() - due > kLate) ++late_;
    }
  }

  std::atomic<bool> stop_{false};
  std::size_t periods_ = 0;
  std::size_t late_ = 0;
  std::thread thread_;
};

}  // namespace abbe::tests

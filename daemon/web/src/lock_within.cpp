#include "lock_within.hpp"

#include <thread>

namespace abbe::web {

std::unique_lock<std::mutex> lock_within(std::mutex& mutex, std::chrono::milliseconds patience,
                                         const std::atomic<bool>& stopping) {
  constexpr std::chrono::milliseconds kPeriod{20};
  const auto until = std::chrono::steady_clock::now() + patience;
  std::unique_lock lock(mutex, std::defer_lock);
  // ThreadSanitizer of g++ 12 does not know the lock with a time-out of std::timed_mutex.
  while (!lock.try_lock() && !stopping && std::chrono::steady_clock::now() < until)
    std::this_thread::sleep_for(kPeriod);
  return lock;
}

}  // namespace abbe::web

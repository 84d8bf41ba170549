#pragma once

#include <atomic>
#include <chrono>
#include <mutex>

namespace abbe::web {

/// Waits for `mutex` for at most `patience`. The lock is without ownership if another one keeps the
/// mutex longer, or once `stopping` is true. Any thread.
[[nodiscard]] std::unique_lock<std::mutex> lock_within(std::mutex& mutex,
                                                       std::chrono::milliseconds patience,
                                                       const std::atomic<bool>& stopping);

}  // namespace abbe::web

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// Passes the latest decision of the subscription's thread to the loop of the feeder. Lock-free:
/// the loop, which has a realtime priority, neither waits for the other thread nor allocates or
/// frees memory.

#include <atomic>
#include <chrono>
#include <deque>
#include <memory>

#include "correction_field.hpp"

namespace abbe::linuxcnc {

class LatestUsable {
 public:
  using Clock = std::chrono::steady_clock;

  /// For the subscription's thread. Also frees the decisions that the loop no longer reads.
  /// `usable` is never null.
  void set(std::shared_ptr<const Usable> usable, Clock::time_point now) {
    if (kept_.back() != usable) {
      kept_.push_back(std::move(usable));
      // release: pairs with the acquire in get()
      latest_.store(kept_.back().get(), std::memory_order_release);
    }
    at_ns_.store(now.time_since_epoch().count(), std::memory_order_relaxed);
    // acquire: pairs with the release in get(); the loop no longer reads what is before it
    const Usable* const in_use = in_use_.load(std::memory_order_acquire);
    while (kept_.front().get() != in_use) kept_.pop_front();
  }

  /// For the loop. The reference is valid until the next call.
  [[nodiscard]] const Usable& get() {
    const Usable* const latest = latest_.load(std::memory_order_acquire);
    in_use_.store(latest, std::memory_order_release);
    return *latest;
  }
  /// For the loop: time since the last decision of the subscription's thread.
  [[nodiscard]] double silence_s(Clock::time_point now) const {
    const std::chrono::nanoseconds at{at_ns_.load(std::memory_order_relaxed)};
    return std::chrono::duration<double>(now.time_since_epoch() - at).count();
  }
  /// For the subscription's thread: number of decisions that are kept.
  [[nodiscard]] std::size_t kept() const { return kept_.size(); }

 private:
  /// The decisions from the one that the loop may be reading to the latest.
  std::deque<std::shared_ptr<const Usable>> kept_{std::make_shared<const Usable>()};
  std::atomic<const Usable*> latest_{kept_.back().get()};
  std::atomic<const Usable*> in_use_{kept_.back().get()};
  std::atomic<std::int64_t> at_ns_{0};
};

}  // namespace abbe::linuxcnc

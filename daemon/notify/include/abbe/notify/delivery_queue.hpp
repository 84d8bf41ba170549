#pragma once
/// The notifications that wait for one receiver. A receiver that is down is tried again with
/// growing pauses; what does not fit is dropped, the oldest first, and counted.
/// Not thread-safe; reads no clock.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "abbe/notify/notification.hpp"

namespace abbe::notify {

struct DeliveryPauses {
  std::chrono::milliseconds first = std::chrono::seconds{5};
  std::chrono::milliseconds longest = std::chrono::minutes{10};  ///< each pause is twice the last
};

class DeliveryQueue {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::size_t kMostWaiting = 100;

  explicit DeliveryQueue(DeliveryPauses pauses, std::size_t most_waiting = kMostWaiting)
      : pauses_(pauses), most_waiting_(most_waiting) {}

  void push(Notification notification);

  /// The notification to send now, and how many were lost since the last one that was accepted.
  struct Attempt {
    Notification notification;
    std::uint64_t not_delivered = 0;
  };
  /// nullopt: nothing waits, or a pause has not ended. One of the three functions below follows.
  [[nodiscard]] std::optional<Attempt> take(Time now);
  void accepted();
  void refused();  ///< by the receiver, for good: lost
  /// The receiver is down: it is sent again after the pause, which is returned.
  std::chrono::milliseconds failed(Time now);

  /// When take() has something; nullopt: not before the next push().
  [[nodiscard]] std::optional<Time> next() const;
  [[nodiscard]] std::size_t waiting() const noexcept { return waiting_.size(); }
  [[nodiscard]] std::uint64_t not_delivered() const noexcept { return lost_; }

 private:
  DeliveryPauses pauses_;
  std::size_t most_waiting_;
  std::deque<Notification> waiting_;
  std::optional<Attempt> in_transit_;
  std::uint64_t lost_ = 0;
  std::chrono::milliseconds pause_{0};
  Time not_before_{};
};

}  // namespace abbe::notify

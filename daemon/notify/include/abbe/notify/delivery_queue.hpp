#pragma once
/// The notifications that wait for one receiver. If the receiver cannot be reached, sending is
/// tried again after pauses of growing length. When the queue is full, the oldest notifications are
/// dropped and counted. Not thread-safe; reads no clock.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "abbe/notify/notification.hpp"

namespace abbe::notify {

struct DeliveryPauses {
  std::chrono::milliseconds first = std::chrono::seconds{5};
  /// longest pause; each pause is twice as long as the one before
  std::chrono::milliseconds longest = std::chrono::minutes{10};
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
  /// The next notification to send; nullopt: none waits, or a pause has not ended. After each
  /// take() that returns a value, call one of the three functions below.
  [[nodiscard]] std::optional<Attempt> take(Time now);
  void accepted();
  void refused();  ///< the receiver refused the notification finally; it is lost
  /// The receiver cannot be reached. The notification is sent again after a pause, which is
  /// returned.
  std::chrono::milliseconds failed(Time now);

  /// Time at which take() will return a value; nullopt: not before the next push().
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

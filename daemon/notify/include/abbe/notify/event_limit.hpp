#pragma once
/// Limits notifications to one of each kind per minute. Events within the minute are held back and
/// sent together: for each subject its latest text, and the number of changes. A device that
/// connects and disconnects every second thus causes one notification a minute. Not thread-safe;
/// reads no clock.

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "abbe/notify/event.hpp"
#include "abbe/notify/notification.hpp"

namespace abbe::notify {

class EventLimit {
 public:
  static constexpr std::chrono::seconds kPeriod{60};
  static constexpr std::size_t kMostHeld = 20;  ///< most subjects in one notification

  /// Events whose kind is not in `wanted` are ignored. `run` is part of every id and is different
  /// each time the process starts.
  EventLimit(std::string machine, std::vector<daemon::NotifyKind> wanted, std::string run)
      : machine_(std::move(machine)), wanted_(std::move(wanted)), run_(std::move(run)) {}

  void add(const Event& event);
  /// The notifications that must be sent now.
  [[nodiscard]] std::vector<Notification> due(std::chrono::steady_clock::time_point now);

 private:
  struct Held {
    std::optional<std::chrono::steady_clock::time_point> sent;
    std::vector<Event> events;  ///< one event for each subject
    std::uint64_t changes = 0;
  };

  [[nodiscard]] Notification notification_of(const Held& held);

  std::string machine_;
  std::vector<daemon::NotifyKind> wanted_;
  std::string run_;
  std::uint64_t sent_ = 0;
  std::map<daemon::NotifyKind, Held> held_;
};

/// A random text, different each time the process starts: 16 hexadecimal digits.
[[nodiscard]] std::string random_run();

/// The notification that `abbe-notify --test` sends.
[[nodiscard]] Notification test_notification(const std::string& machine, protocol::UtcTime now);

}  // namespace abbe::notify

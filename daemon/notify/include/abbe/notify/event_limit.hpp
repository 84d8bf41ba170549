#pragma once
/// At most one notification of each kind in a minute. Events in between are held back and sent
/// together, with the number of changes; of each subject with its latest text. So a device that
/// comes and goes every second gives one notification a minute. Not thread-safe; reads no clock.

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
  static constexpr std::size_t kMostHeld = 20;  ///< subjects in one notification

  /// Events of other kinds than `wanted` are ignored. `run` is part of every id and differs from
  /// run to run of the process.
  EventLimit(std::string machine, std::vector<daemon::NotifyKind> wanted, std::string run)
      : machine_(std::move(machine)), wanted_(std::move(wanted)), run_(std::move(run)) {}

  void add(const Event& event);
  /// What is to be sent now.
  [[nodiscard]] std::vector<Notification> due(std::chrono::steady_clock::time_point now);

 private:
  struct Held {
    std::optional<std::chrono::steady_clock::time_point> sent;
    std::vector<Event> events;  ///< one of each subject
    std::uint64_t changes = 0;
  };

  [[nodiscard]] Notification notification_of(const Held& held);

  std::string machine_;
  std::vector<daemon::NotifyKind> wanted_;
  std::string run_;
  std::uint64_t sent_ = 0;
  std::map<daemon::NotifyKind, Held> held_;
};

/// A text that differs from run to run: 16 hexadecimal digits.
[[nodiscard]] std::string random_run();

/// The notification of `abbe-notify --test`.
[[nodiscard]] Notification test_notification(const std::string& machine, protocol::UtcTime now);

}  // namespace abbe::notify

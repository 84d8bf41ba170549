#pragma once
/// Notifications to systemd from a service of Type=notify. If systemd does not run the program,
/// these functions do nothing.

#include <chrono>
#include <optional>
#include <string_view>

namespace abbe::daemon {

void notify_ready(std::string_view status);
void notify_stopping();
/// A line for `systemctl status`.
void notify_status(std::string_view status);
void notify_alive();  ///< resets the watchdog timer
/// Period for notify_alive(): half of WatchdogSec. nullopt if the service has no watchdog.
[[nodiscard]] std::optional<std::chrono::microseconds> watchdog_period();

}  // namespace abbe::daemon

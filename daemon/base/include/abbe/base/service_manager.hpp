#pragma once
/// What systemd wants to hear from a service of Type=notify, and how often. Without systemd nothing
/// happens.

#include <chrono>
#include <optional>
#include <string_view>

namespace abbe::daemon {

void tell_ready(std::string_view status);
void tell_stopping();
void tell_alive();  ///< feeds the watchdog
/// How often the watchdog wants to be fed: half of WatchdogSec; nothing if there is none.
[[nodiscard]] std::optional<std::chrono::microseconds> watchdog_period();

}  // namespace abbe::daemon

#pragma once
/// A change of state that is reported to people.

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "abbe/config/notify_config.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::notify {

using daemon::NotifyKind;

enum class Severity { Info, Warning, Fault };

/// Begins, Ends: the begin or end of a state that lasts. Happened: any other event.
enum class Phase { Happened, Begins, Ends };

[[nodiscard]] std::string_view name_of(Severity severity) noexcept;  ///< "info", "warning", "fault"
[[nodiscard]] std::string_view name_of(Phase phase) noexcept;  ///< "happened", "begins", "ends"

struct Event {
  NotifyKind kind = NotifyKind::NotReachable;
  Phase phase = Phase::Happened;
  Severity severity = Severity::Info;
  std::string subject{};      ///< the subject of the event: a device, "model", "calibration 3"
  std::string text{};         ///< the text that status and page also show
  std::string model_id{};     ///< empty: the event concerns no model
  std::uint64_t session = 0;  ///< number of the calibration; 0: none
  bool simulated = false;     ///< the devices are simulated
  protocol::UtcTime time{};   ///< time at which the event was detected
};

/// The present time, read by the caller.
struct Moment {
  std::chrono::steady_clock::time_point steady;
  protocol::UtcTime utc;
};

}  // namespace abbe::notify

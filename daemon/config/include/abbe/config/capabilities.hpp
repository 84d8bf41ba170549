#pragma once
/// What the configured devices provide, whatever their kinds are: the other modules ask here, and
/// only the code of a kind looks at its own table. Pure.

#include <optional>
#include <string>
#include <string_view>

namespace abbe::daemon {

struct Config;

/// The device that delivers touches.
struct TouchSource {
  std::string_view table;  ///< that configures it, as in messages: "[cmm]"
  std::string device;      ///< its name
  /// True: it reports the position of each touch. False: a touch has the readings of the axes.
  bool reports_positions = false;
  bool compensated = false;  ///< it corrects the positions that it reports
};
[[nodiscard]] std::optional<TouchSource> touch_source(const Config& config);

/// The tables, as in messages, of all kinds of devices with a capability, also if they are not
/// configured: "[a], [b] CONJUNCTION [c]".
[[nodiscard]] std::string touch_tables(std::string_view conjunction);
/// Of the kinds that move and touch points under their own control.
[[nodiscard]] std::string moving_tables();

}  // namespace abbe::daemon

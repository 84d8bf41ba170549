#pragma once
/// What the configuration needs to know of one kind of device. Each kind is defined in one file of
/// src/kinds; config_kinds() are the kinds of DeviceConfigs.

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/config/capabilities.hpp"
#include "abbe/config/config.hpp"
#include "abbe/config/section.hpp"
#include "stream_names.hpp"

namespace abbe::daemon {

/// A line of `abbed --check-config`.
struct SummaryLine {
  std::string what, text;
};

/// How a device reads the axes.
struct AxisReadings {
  std::vector<std::string> axes;  ///< in the order of a sample; empty: the first of the machine
  bool compensated = false;       ///< the control already corrects them
};

/// A function that takes a Config returns an empty result if it has no device of the kind. A null
/// pointer means that no device of the kind has this part.
struct ConfigKind {
  std::string_view table;               ///< as in messages: "[cmm]"
  std::string_view configured = table;  ///< what must be in the file: "[tracker] host"
  /// Reads and checks the table, adds the device to `out`, and takes its name. The kinds before it
  /// in DeviceConfigs are read already.
  void (*read)(Section& root, Config& out, StreamNames& names);
  std::vector<SummaryLine> (*summary)(const Config& config);
  /// Part of machine_hash(): what the meaning of a scale reading depends on.
  std::string (*reading_text)(const Config& config) = nullptr;

  bool moves = false;  ///< it moves and touches points under its own control
  std::optional<AxisReadings> (*axes)(const Config& config) = nullptr;
  /// Its positions are the axis readings only if no device of another kind reads the axes.
  bool axes_if_no_other = false;
  std::optional<TouchSource> (*touches)(const Config& config) = nullptr;
};

[[nodiscard]] std::span<const ConfigKind> config_kinds();

/// True if a device of a kind without `axes_if_no_other` reads the axes.
[[nodiscard]] bool axes_have_own_device(const Config& config);
/// Of all devices that read the axes.
[[nodiscard]] std::vector<AxisReadings> axis_readings(const Config& config);
/// Of the kinds that read the axes; as touch_tables().
[[nodiscard]] std::string axis_tables(std::string_view conjunction);

}  // namespace abbe::daemon

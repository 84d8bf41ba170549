#pragma once
/// The properties of one kind of device that the configuration module needs. Each kind of
/// DeviceConfigs is defined in one file of src/kinds; config_kinds() lists all of them.

#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/config/capabilities.hpp"
#include "abbe/config/config.hpp"
#include "abbe/settings/section.hpp"
#include "classified_section.hpp"
#include "stream_names.hpp"

namespace abbe::daemon {

/// The axis readings of a device.
struct AxisReadings {
  std::string_view key;  ///< key of the device's table
  /// names in the order of a sample; empty: the first axes of the machine
  std::vector<std::string> axes;
  bool compensated = false;  ///< the control already corrects them
};

/// One kind of device in the configuration. Each function that takes a Config returns an empty
/// result if no device of the kind is configured. A null pointer means that the kind does not have
/// the capability of this member.
struct ConfigKind {
  std::string_view key;         ///< key of the kind's table
  bool several = false;         ///< an array of tables: [[KEY]]
  std::string_view needs = {};  ///< key without which a table configures no device

  /// Reads and checks the table of this kind, adds the device to `out` and its name to `names`. The
  /// kinds that precede this one in DeviceConfigs have been read already.
  void (*read)(ClassifiedSection& root, Config& out, StreamNames& names);
  /// Adds, with ClassifiedSection::state(), the meaning that keys of the kind have together with
  /// other tables. Called after all tables were read.
  void (*state)(ClassifiedSection& root, const Config& config) = nullptr;
  /// Reports each value that is possible but improbable with Section::fault(). check_config()
  /// prints these faults as warnings.
  void (*doubt)(Section& root, const Config& config) = nullptr;
  /// The lines about the devices of this kind in `abbed --check-config`, one for each device.
  std::vector<std::string> (*summary)(const Config& config);
  /// The text of this kind in former_machine_hash(). A new kind has none.
  std::string (*former_text)(const Config& config) = nullptr;

  // Capabilities of the kind; see capabilities.hpp.
  std::optional<MotionSource> (*motion)(const Config& config) = nullptr;
  std::optional<AxisReadings> (*axes)(const Config& config) = nullptr;
  /// True: the positions of the device are the axis readings only if no other kind of device reads
  /// the axes.
  bool axes_if_no_other = false;
  std::optional<std::chrono::nanoseconds> (*time_of_axis_samples)(const Config& config,
                                                                  double periods) = nullptr;
  std::optional<TrackerSource> (*points)(const Config& config) = nullptr;
  std::optional<TouchSource> (*touches)(const Config& config) = nullptr;
  std::optional<CountedAxes> (*counted)(const Config& config) = nullptr;
  const ReferenceMarks* (*marks)(const Config& config) = nullptr;
  std::vector<EnvironmentSource> (*environment)(const Config& config) = nullptr;
};

[[nodiscard]] std::span<const ConfigKind> config_kinds();

/// Same as tables_with(), but each table is followed by the key that it requires: "[a] key or [b]".
[[nodiscard]] std::string needed_for(Capability capability);

/// The axis readings of all devices that read the axes.
[[nodiscard]] std::vector<AxisReadings> axis_readings(const Config& config);
/// Adds a fault at `key` of the table `own` if a device of another table reads this axis already.
void refuse_claimed_axis(ClassifiedSection& table, std::string_view key, const std::string& axis,
                         std::string_view own, const Config& config);
/// True if a device that always reads the axes (a kind without `axes_if_no_other`) is configured.
[[nodiscard]] bool axes_have_own_device(const Config& config);

}  // namespace abbe::daemon

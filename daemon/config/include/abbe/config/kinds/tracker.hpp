#pragma once
/// [tracker]: the connected laser tracker. Pure data. The standard deviations of its points, in the
/// same table, are members of MachineConfig.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/config/kinds/tracker_lines.hpp"

namespace abbe::daemon {

struct ConfigKind;

/// None: the controller's weather station is not read. Read: its values are read and recorded.
/// Compute: they are read and recorded, and the controller computes the refractive index from them
/// and corrects its distances.
enum class WeatherConfig { None, Read, Compute };

/// Continuous: the tracker measures during motion, for on-the-fly runs. Stationary: it delivers one
/// mean value after another, for verification at standstills; on-the-fly runs are not possible.
enum class TrackerModeConfig { Continuous, Stationary };

/// Search of the tracker for its reflector. One command of emScon sets both values.
struct TrackerSearchConfig {
  double radius_m = 0.0;
  std::chrono::nanoseconds timeout{};  ///< time-out of the search; a whole number of ms
};

struct TrackerConfig {
  static const ConfigKind kKind;
  std::string name = "tracker";
  /// Set if the points come as lines of text. `host`, `port` and the members that only emScon uses
  /// are then not used.
  std::optional<LinesConfig> lines;
  std::string host;
  std::uint16_t port = 700;
  TrackerModeConfig mode = TrackerModeConfig::Continuous;
  double point_rate_hz = 500.0;  ///< used only in mode Continuous
  /// duration of the measurement of one mean value; a whole number of ms
  std::chrono::nanoseconds stationary_time{std::chrono::milliseconds{500}};
  WeatherConfig weather = WeatherConfig::Compute;
  /// Relative standard uncertainty common to all distances of the tracker. Default:
  /// - weather = "compute": 2e-7, from the controller's own sensors (0.2 K and 30 Pa);
  /// - with [air] assumed_index: 0, because the uncertainty of the air measured by abbe is added
  ///   later;
  /// - else u_of_unmeasured_air(), because the distances are not corrected for measured air.
  double u_scale = kControllersAir;
  static constexpr double kControllersAir = 0.2 / 1e6;
  /// Upper bound of the constant part of the delay between measurement and arrival of a point. This
  /// part cannot be estimated from arrival times.
  std::chrono::nanoseconds max_constant_delay{std::chrono::milliseconds{2}};
  std::chrono::nanoseconds connect_timeout{std::chrono::seconds{3}};
  std::chrono::nanoseconds command_timeout{std::chrono::seconds{3}};
  std::chrono::nanoseconds initialize_timeout{std::chrono::seconds{120}};
  /// It is a fault if no data come for longer than this during a measurement.
  std::chrono::nanoseconds silence_timeout{std::chrono::milliseconds{1500}};
  /// name or id in the controller's list; empty: the reflector that is set there
  std::string reflector;
  /// The tracker moves its beam to the home position (bird bath) after Initialize.
  bool home_after_initialize = false;
  /// Search around the direction of the beam. nullopt: the controller's settings are not changed.
  std::optional<TrackerSearchConfig> search;
};

/// Reads and checks the text of the table alone, as load_config() does with a whole file. The table
/// must configure a device.
[[nodiscard]] Result<TrackerConfig> parse_tracker_table(std::string_view text);

}  // namespace abbe::daemon

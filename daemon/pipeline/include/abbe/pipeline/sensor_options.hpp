#pragma once
/// The sensors whose readings are checked, with their limits. The limits come from defaults by kind
/// of sensor, and from [[sensors.limit]]. Pure data.

#include <chrono>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/environment/sensor_check.hpp"
#include "abbe/config/config.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// Index of a quantity in EnvironmentSample: the air first, then temperature_K.
inline constexpr std::size_t kAirTemperaturePlace = 0, kAirPressurePlace = 1,
                             kRelativeHumidityPlace = 2, kFirstTemperaturePlace = 3,
                             kSensorPlaces = kFirstTemperaturePlace + protocol::kMaxTemperatures;
[[nodiscard]] protocol::EnvironmentMask mask_of_place(std::size_t place) noexcept;
[[nodiscard]] double& value_at(protocol::EnvironmentSample& sample, std::size_t place) noexcept;
[[nodiscard]] double value_at(const protocol::EnvironmentSample& sample,
                              std::size_t place) noexcept;

struct CheckedSensor {
  std::size_t place = 0;
  std::string name;    ///< "scale_x", "air_temperature"
  std::string device;  ///< name of the device that measures it
  calib::SensorLimits limits;
  std::chrono::nanoseconds hold{};
  std::optional<std::size_t> twin;  ///< index of another sensor at the same place of the machine
  double most_twin_difference = std::numeric_limits<double>::infinity();
  /// True for scales and air of one machine: a first reading is compared with the other sensors of
  /// this group.
  bool near_others = false;
  /// Limit of the rate at which the applied value follows the readings; infinity: the readings are
  /// applied as they are.
  double correction_per_s = std::numeric_limits<double>::infinity();
  std::vector<std::string> axes = {};  ///< axes whose readings are corrected with this sensor
};

/// If there are no sensors, nothing is checked.
struct SensorCheckOptions {
  std::vector<CheckedSensor> sensors;
  double start_spread_K = std::numeric_limits<double>::infinity();
};

/// The default limits; drivers/docs/environment.md gives the reasons.
[[nodiscard]] SensorCheckOptions sensor_check_options(const Config& config);

/// Key in the version entries of a recording. In a recording with this key, the live run checked
/// the sensors. In one without it (older versions of abbe), the readings were used as they were,
/// and a replay does the same.
inline constexpr const char* kSensorRule = "sensor_checks";

}  // namespace abbe::daemon

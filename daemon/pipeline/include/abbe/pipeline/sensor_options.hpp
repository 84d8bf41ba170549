#pragma once
/// The sensors whose readings are checked, with limits by kind of sensor (defaults) and by
/// [[sensors.limit]]. Pure data.

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

/// Place of a quantity in EnvironmentSample: the air first, then temperature_K.
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
  std::string device;  ///< that measures it
  calib::SensorLimits limits;
  std::chrono::nanoseconds hold{};
  std::optional<std::size_t> twin;  ///< place of the sensor at the same place of the machine
  double most_twin_difference = std::numeric_limits<double>::infinity();
  /// Scales and air of one machine: a first reading is compared with the others of them.
  bool near_others = false;
  /// Limit of the rate of the value that is applied; infinity: as read.
  double correction_per_s = std::numeric_limits<double>::infinity();
  std::vector<std::string> axes = {};  ///< whose readings are corrected with it
};

/// Without sensors nothing is checked.
struct SensorCheckOptions {
  std::vector<CheckedSensor> sensors;
  double start_spread_K = std::numeric_limits<double>::infinity();
};

/// Defaults of the limits, why: drivers/docs/environment.md.
[[nodiscard]] SensorCheckOptions sensor_check_options(const Config& config);

/// Key in the version entries of a recording. With it, the live run checked the sensors. Without it
/// (older versions of abbe), their readings were used as they were, and a replay does so, too.
inline constexpr const char* kSensorRule = "sensor_checks";

}  // namespace abbe::daemon

#include "abbe/pipeline/sensor_options.hpp"

#include <algorithm>

#include "abbe/base/units.hpp"
#include "abbe/config/capabilities.hpp"

namespace abbe::daemon {
namespace {

using calib::SensorLimits;
using protocol::EnvironmentMask;

constexpr double kPerMinute = 1.0 / 60.0;
constexpr double kPascalsPerHectopascal = 100.0;
/// A history lasts for this number of periods of a slow device.
constexpr int kReadingsRemembered = 5;

constexpr double celsius(double value_C) {
  return value_C + kZeroCelsius_K;
}

/// Limits for a scale or an artefact on a machine in a hall: a metal part of some kilograms. It
/// warms up by 5 to 20 K/h, and by 1 K/min under a flood of coolant.
SensorLimits scale_limits() {
  return {.lowest = celsius(0.0),
          .highest = celsius(50.0),
          .most_per_s = 2.0 * kPerMinute,
          .tolerance = 0.5,
          .celsius_power_on_values = true};
}

/// Limits for air in a hall, which changes by 3 K/min when a door is opened in winter.
SensorLimits air_limits() {
  return {.lowest = celsius(-10.0),
          .highest = celsius(50.0),
          .most_per_s = 10.0 * kPerMinute,
          .tolerance = 1.0,
          .celsius_power_on_values = true};
}

/// Limits for parts, coolant and motors. No correction uses them.
SensorLimits part_limits() {
  return {.lowest = celsius(-50.0),
          .highest = celsius(200.0),
          .most_per_s = 30.0 * kPerMinute,
          .tolerance = 1.0,
          .celsius_power_on_values = true};
}

/// Limits for the pressure. A storm changes it by 10 hPa/h, a ventilation or an opened gate by 1
/// hPa at once.
SensorLimits pressure_limits() {
  return {.lowest = 600.0 * kPascalsPerHectopascal,
          .highest = 1100.0 * kPascalsPerHectopascal,
          .most_per_s = 2.0 * kPascalsPerHectopascal * kPerMinute,
          .tolerance = 3.0 * kPascalsPerHectopascal};
}

SensorLimits humidity_limits() {
  return {.lowest = 0.0, .highest = 1.05, .most_per_s = 0.2 * kPerMinute, .tolerance = 0.1};
}

bool is_scale(const Config& config, std::size_t temperature) {
  return std::ranges::any_of(config.thermal,
                             [&](const ThermalConfig& t) { return t.temperature == temperature; });
}

bool is_artefact(const Config& config, std::size_t temperature) {
  return config.evemu.artefact && config.evemu.artefact->sensor == temperature;
}

SensorLimits default_limits(const Config& config, std::size_t place) {
  if (place == kAirTemperaturePlace) return air_limits();
  if (place == kAirPressurePlace) return pressure_limits();
  if (place == kRelativeHumidityPlace) return humidity_limits();
  const std::size_t temperature = place - kFirstTemperaturePlace;
  return is_scale(config, temperature) || is_artefact(config, temperature) ? scale_limits()
                                                                           : part_limits();
}

std::string name_of(const Config& config, std::size_t place) {
  if (place == kAirTemperaturePlace) return "air_temperature";
  if (place == kAirPressurePlace) return "air_pressure";
  if (place == kRelativeHumidityPlace) return "relative_humidity";
  return config.temperatures[place - kFirstTemperaturePlace];
}

std::optional<std::size_t> place_of(const Config& config, const std::string& name) {
  const std::size_t places = kFirstTemperaturePlace + config.temperatures.size();
  for (std::size_t place = 0; place < std::min(places, kSensorPlaces); ++place)
    if (name_of(config, place) == name) return place;
  return std::nullopt;
}

/// Sets the options of a sensor of a device that measures in rounds.
void set_device(const Config& config, const EnvironmentSource& device, CheckedSensor& sensor) {
  sensor.device = device.device;
  sensor.hold = config.sensors.hold;
  sensor.limits.forget_after = std::max(config.sensors.forget, kReadingsRemembered * device.period);
}

/// Sets the options of a sensor of the tracker's controller. A reading arrives when it changes, and
/// every ten seconds while points arrive. Therefore a second reading does not soon confirm the
/// first, and a refused value is not held.
void set_weather_station(const Config& config, const TrackerSource& tracker,
                         CheckedSensor& sensor) {
  sensor.device = tracker.device;
  sensor.hold = std::chrono::nanoseconds{0};
  sensor.limits.agreeing = 1;
  sensor.limits.forget_after = config.sensors.forget;
}

void set_scale(const Config& config, CheckedSensor& sensor) {
  for (const ThermalConfig& thermal : config.thermal)
    if (kFirstTemperaturePlace + thermal.temperature == sensor.place)
      sensor.axes.push_back(thermal.axis);
  sensor.near_others = !sensor.axes.empty() || sensor.place == kAirTemperaturePlace;
  if (!sensor.axes.empty()) sensor.correction_per_s = config.sensors.correction_K_per_s;
}

void set_limit(const Config& config, const SensorLimitConfig& limit, CheckedSensor& sensor) {
  if (limit.lowest) sensor.limits.lowest = *limit.lowest;
  if (limit.highest) sensor.limits.highest = *limit.highest;
  if (limit.most_per_s) sensor.limits.most_per_s = *limit.most_per_s;
  if (limit.tolerance) sensor.limits.tolerance = *limit.tolerance;
  if (limit.twin.empty()) return;
  sensor.twin = place_of(config, limit.twin);
  sensor.most_twin_difference = limit.most_twin_difference_K;
}

/// The sensor of the quantity; nullopt if no device measures it.
std::optional<CheckedSensor> sensor_at(const Config& config, std::size_t place) {
  CheckedSensor sensor{.place = place, .limits = default_limits(config, place)};
  sensor.name = name_of(config, place);
  const auto tracker = tracker_source(config);
  const auto devices = environment_sources(config);
  const auto device = std::ranges::find_if(devices, [&](const EnvironmentSource& source) {
    return (source.measured & mask_of_place(place)) != 0;
  });
  if (device != devices.end()) {
    set_device(config, *device, sensor);
  } else if (tracker && place < kFirstTemperaturePlace) {
    set_weather_station(config, *tracker, sensor);
  } else {
    return std::nullopt;
  }
  set_scale(config, sensor);
  for (const auto& limit : config.sensors.limits)
    if (limit.name == sensor.name) set_limit(config, limit, sensor);
  return sensor;
}

/// Makes each twin the twin of the other.
void pair_twins(std::vector<CheckedSensor>& sensors) {
  for (CheckedSensor& sensor : sensors) {
    if (!sensor.twin) continue;
    const auto other = std::ranges::find(sensors, *sensor.twin, &CheckedSensor::place);
    if (other == sensors.end()) {
      sensor.twin.reset();
    } else if (!other->twin) {
      other->twin = sensor.place;
      other->most_twin_difference = sensor.most_twin_difference;
    }
  }
}

}  // namespace

EnvironmentMask mask_of_place(std::size_t place) noexcept {
  switch (place) {
    case kAirTemperaturePlace:
      return protocol::kAirTemperature;
    case kAirPressurePlace:
      return protocol::kAirPressure;
    case kRelativeHumidityPlace:
      return protocol::kRelativeHumidity;
    default:
      return protocol::temperature_bit(place - kFirstTemperaturePlace);
  }
}

double& value_at(protocol::EnvironmentSample& sample, std::size_t place) noexcept {
  switch (place) {
    case kAirTemperaturePlace:
      return sample.air_temperature_K;
    case kAirPressurePlace:
      return sample.air_pressure_Pa;
    case kRelativeHumidityPlace:
      return sample.relative_humidity;
    default:
      return sample.temperature_K[place - kFirstTemperaturePlace];
  }
}

double value_at(const protocol::EnvironmentSample& sample, std::size_t place) noexcept {
  auto copy = sample;
  return value_at(copy, place);
}

SensorCheckOptions sensor_check_options(const Config& config) {
  SensorCheckOptions options;
  if (!config.sensors.check) return options;
  options.start_spread_K = config.sensors.start_spread_K;
  const std::size_t places = kFirstTemperaturePlace + config.temperatures.size();
  for (std::size_t place = 0; place < std::min(places, kSensorPlaces); ++place)
    if (auto sensor = sensor_at(config, place)) options.sensors.push_back(std::move(*sensor));
  pair_twins(options.sensors);
  return options;
}

}  // namespace abbe::daemon

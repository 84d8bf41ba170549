#include "sensor_text.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <cmath>
#include <string_view>

#include "abbe/base/units.hpp"

namespace abbe::daemon {
namespace {

using calib::SensorDoubt;

struct Shown {
  double zero, per_si;
  std::string_view unit;
};

Shown shown(std::size_t place) {
  if (place == kAirPressurePlace) return {0.0, 0.01, "hPa"};
  if (place == kRelativeHumidityPlace) return {0.0, 100.0, "%"};
  return {kZeroCelsius_K, 1.0, "C"};
}

std::string value_text(std::size_t place, double value) {
  const Shown as = shown(place);
  return fmt::format("{:.2f} {}", (value - as.zero) * as.per_si, as.unit);
}

std::string range_text(std::size_t place, double lowest, double highest) {
  const Shown as = shown(place);
  return fmt::format("{:.2f} to {:.2f} {}", (lowest - as.zero) * as.per_si,
                     (highest - as.zero) * as.per_si, as.unit);
}

/// The reading of the sensor and the expected values, as text.
std::string cause_of_doubt(const CheckedSensor& sensor, const DoubtedReading& d) {
  const auto reads = [&] {
    return fmt::format("it reads {}", value_text(sensor.place, d.reading));
  };
  const auto expected = [&] {
    return std::isfinite(d.lowest)
               ? fmt::format(", expected {}", range_text(sensor.place, d.lowest, d.highest))
               : std::string{};
  };
  switch (d.doubt) {
    case SensorDoubt::None:
      return {};
    case SensorDoubt::NoValue:
      return fmt::format("{} sends no value", sensor.device);
    case SensorDoubt::PowerOnValue:
      return reads() + ", which sensors send before they have measured";
    case SensorDoubt::Unconfirmed:
      return reads() + (expected().empty() ? ", its first value" : expected() + " as just before");
    case SensorDoubt::Jump:
      return fmt::format("it jumped to {}{}", value_text(sensor.place, d.reading), expected());
    case SensorDoubt::Twin:
      return fmt::format("{}{} as its twin {}", reads(), expected(), d.twin);
    case SensorDoubt::Others:
      return reads() + expected() + " as the scales, the air and its last value";
    case SensorDoubt::OutOfRange:
      return reads() + expected();
  }
  return {};
}

std::string remedy_of(const CheckedSensor& sensor, SensorDoubt doubt) {
  switch (doubt) {
    case SensorDoubt::None:
      return {};
    case SensorDoubt::NoValue:
      return "check the sensor and its cable";
    case SensorDoubt::Unconfirmed:
      return "used when two readings agree";
    case SensorDoubt::PowerOnValue:
      return "check its supply and its cable";
    case SensorDoubt::OutOfRange:
      return "check the sensor, its type and unit, and [[sensors.limit]]";
    case SensorDoubt::Twin:
      return "check both";
    case SensorDoubt::Jump:
    case SensorDoubt::Others:
      return fmt::format(
          "check the sensor, its cable and its address; if it is right: abbe sensors accept {} "
          "--why REASON",
          sensor.name);
  }
  return {};
}

std::string consequence(const CheckedSensor& sensor, const DoubtedReading& d) {
  const std::string axes = fmt::format("{}", fmt::join(sensor.axes, ", "));
  const std::string_view verb = sensor.axes.size() > 1 ? "are" : "is";
  if (d.held) {
    const auto hold_s = std::chrono::duration_cast<std::chrono::seconds>(sensor.hold).count();
    const std::string then = axes.empty() ? "" : fmt::format(", then {} {} missing", axes, verb);
    return fmt::format("{} is not used ({} is used for {} s{})", sensor.name,
                       value_text(sensor.place, d.used), hold_s, then);
  }
  return axes.empty() ? fmt::format("{} is not available", sensor.name)
                      : fmt::format("{} is not available ({} {} missing)", sensor.name, axes, verb);
}

}  // namespace

std::string text_of(const CheckedSensor& sensor, const DoubtedReading& doubted) {
  return fmt::format("{}: {}; {}", consequence(sensor, doubted), cause_of_doubt(sensor, doubted),
                     remedy_of(sensor, doubted.doubt));
}

std::string future_text(const CheckedSensor& sensor, std::chrono::nanoseconds ahead) {
  return fmt::format(
      "{}: a reading dated {:.1f} s in the future is not used; check the clock of {} and the load "
      "of the computer",
      sensor.name, std::chrono::duration<double>(ahead).count(), sensor.device);
}

}  // namespace abbe::daemon

#pragma once
/// Checks whether a reading of a temperature, pressure or humidity sensor can be used. Faulty
/// sensors often send numbers that look plausible: the value before the first measurement (85 C),
/// the value of another input, Fahrenheit. Four parts with plain inputs and outputs, each usable
/// alone:
///   check_reading()   range, value before the first measurement, rate of change
///   twins_differ()    two sensors at one place
///   far_from_others() first reading against the other sensors of the machine
///   held_value()      value to use while readings cannot be used
/// followed_value.hpp limits the rate at which the applied correction follows the result. Values
/// are in the unit of the sensor (K, Pa, 1), instants since any epoch. Deterministic; any thread.

#include <chrono>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>

namespace abbe::calib {

/// Why a reading is not used.
enum class SensorDoubt {
  None,
  NoValue,       ///< the device reports that it has no value
  OutOfRange,    ///< outside SensorLimits::lowest to highest
  PowerOnValue,  ///< without a history: a value that sensors send before their first measurement
  Unconfirmed,   ///< without a history: no second reading agrees with it yet
  Jump,          ///< changed faster than SensorLimits::most_per_s
  Twin,          ///< differs from the sensor at the same place
  Others,        ///< without a history: too far from the other sensors of the machine
};

struct SensorLimits {
  double lowest = -std::numeric_limits<double>::infinity();
  double highest = std::numeric_limits<double>::infinity();
  /// Upper bound of the rate of a real change at the place of the sensor.
  double most_per_s = std::numeric_limits<double>::infinity();
  /// Deviation that is always accepted: noise, resolution and small steps.
  double tolerance = std::numeric_limits<double>::infinity();
  /// Without a history: number of consecutive readings that must agree within `tolerance` before a
  /// reading is used.
  int agreeing = 2;
  bool celsius_power_on_values = false;  ///< also reject the power-on values of a temperature in K:
                                         ///< is_power_on_value()
  /// The history is discarded after this time without a reading within the range.
  std::chrono::nanoseconds forget_after = std::chrono::minutes{10};
};

/// State of the check of one sensor. Zero-initialised: no reading yet.
struct SensorTrack {
  bool has_history = false;
  /// Value with which the next reading is compared. It follows the readings that were used at a
  /// rate of at most most_per_s.
  double reference = 0.0;
  std::chrono::nanoseconds at{};  ///< instant of the last reading within the range
  int agreed = 0;                 ///< without a history: number of consecutive readings that agree
  std::optional<std::chrono::nanoseconds> doubted_since = {};
  double slack = 0.0;  ///< during a doubt: change that was possible between the last used reading
                       ///< and the first refused one
};

struct CheckedReading {
  SensorDoubt doubt = SensorDoubt::None;
  double lowest = 0.0, highest = 0.0;  ///< range of the expected readings; NaN: any reading is
                                       ///< expected
  [[nodiscard]] bool usable() const noexcept { return doubt == SensorDoubt::None; }
};

/// True for temperatures, to 0.1 mK, that sensors send without a measurement: 85 C (DS18B20 after
/// power-on), 127 C and -127 C (bus without a sensor), 0 C (empty register). check_reading()
/// refuses them only without a history, because a sensor may really warm up to 85 C.
[[nodiscard]] bool is_power_on_value(double temperature_K) noexcept;

/// Checks `reading` (NaN: none), taken at `at`, and updates `track`. A refused reading does not
/// move the reference. The tolerance grows to twice its value within the first three minutes of
/// doubt and then stays. A sensor with a short fault is thus accepted again; a jump by more than
/// this tolerance is refused however long it lasts.
[[nodiscard]] CheckedReading check_reading(SensorTrack& track, const SensorLimits& limits,
                                           double reading, std::chrono::nanoseconds at);

/// True from the second consecutive comparison in which `a` and `b` differ by more than `most`.
/// `in_a_row` counts these comparisons between the calls.
[[nodiscard]] bool twins_differ(int& in_a_row, double a, double b, double most) noexcept;

/// True if `reading` is farther than `most` from the median of `others`; false without others.
[[nodiscard]] bool far_from_others(double reading, std::span<const double> others, double most);
/// Median; for an even number of values the larger of the two middle values. NaN without values.
[[nodiscard]] double median_of(std::span<const double> values);

/// The last usable value and its instant.
struct HeldValue {
  double value = std::numeric_limits<double>::quiet_NaN();
  std::chrono::nanoseconds at{};
};
/// Returns `usable` and holds it, if it is given. Otherwise returns the held value until `hold_for`
/// after its instant, then NaN.
[[nodiscard]] double held_value(HeldValue& held, std::optional<double> usable,
                                std::chrono::nanoseconds at, std::chrono::nanoseconds hold_for);

}  // namespace abbe::calib

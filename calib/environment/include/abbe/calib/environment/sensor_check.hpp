#pragma once
/// Whether a reading of a temperature, pressure or humidity sensor can be used. Sensors that break
/// often send numbers that are plausible by themselves: the value before the first measurement
/// (85 C), the value of another input, Fahrenheit. Four parts with plain inputs and outputs, each
/// usable alone:
///   check_reading()   range, value before the first measurement, rate of change
///   twins_differ()    two sensors at one place
///   far_from_others() first reading against the other sensors of the machine
///   held_value()      what is used while the readings are not
/// The applied correction follows the result at a limited rate: followed_value.hpp. Values are in
/// the unit of the sensor (K, Pa, 1), instants since any epoch. Deterministic; any thread.

#include <chrono>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>

namespace abbe::calib {

/// Why a reading is not used.
enum class SensorDoubt {
  None,
  NoValue,       ///< the device reports that it has none
  OutOfRange,    ///< outside SensorLimits::lowest to highest
  PowerOnValue,  ///< without a history: a value that sensors send before they have measured
  Unconfirmed,   ///< without a history: no second reading that agrees yet
  Jump,          ///< faster than SensorLimits::most_per_s
  Twin,          ///< differs from the sensor at the same place
  Others,        ///< without a history: too far from the other sensors of the machine
};

struct SensorLimits {
  double lowest = -std::numeric_limits<double>::infinity();
  double highest = std::numeric_limits<double>::infinity();
  /// Fastest real change. Larger than any that the place of the sensor can have.
  double most_per_s = std::numeric_limits<double>::infinity();
  /// Noise, resolution and small steps: always accepted.
  double tolerance = std::numeric_limits<double>::infinity();
  /// Number of readings in a row that agree within `tolerance` before the first is used.
  int agreeing = 2;
  bool celsius_power_on_values = false;  ///< of a temperature in K: see is_power_on_value()
  /// After this time without a reading within the range the history is discarded.
  std::chrono::nanoseconds forget_after = std::chrono::minutes{10};
};

/// What is known of a sensor. Zero-initialised: nothing.
struct SensorTrack {
  bool has_history = false;
  /// The last reading that was used, followed at most at most_per_s.
  double reference = 0.0;
  std::chrono::nanoseconds at{};  ///< of the last reading within the range
  int agreed = 0;                 ///< without a history: readings in a row that agree
  std::optional<std::chrono::nanoseconds> doubted_since = {};
  double slack = 0.0;  ///< while in doubt: the change that was possible until the doubt began
};

struct CheckedReading {
  SensorDoubt doubt = SensorDoubt::None;
  double lowest = 0.0, highest = 0.0;  ///< of the expected readings; NaN: nothing is expected
  [[nodiscard]] bool usable() const noexcept { return doubt == SensorDoubt::None; }
};

/// Values, in K, that sensors send without having measured, to 0.1 mK: 85 C (DS18B20 after
/// power-on), 127 C and -127 C (bus without a sensor), 0 C (empty register). They are refused only
/// without a history: a sensor that rises to 85 C is right.
[[nodiscard]] bool is_power_on_value(double temperature_K) noexcept;

/// Judges `reading` (NaN: none) taken at `at`, and updates `track`. A reading that is refused does
/// not move the reference; the tolerance grows to twice its value within three minutes of doubt, so
/// that a sensor that worked badly for a while is accepted again, and a jump of more than that is
/// not, however long it lasts.
[[nodiscard]] CheckedReading check_reading(SensorTrack& track, const SensorLimits& limits,
                                           double reading, std::chrono::nanoseconds at);

/// True from the second comparison in a row that differs by more than `most`. `in_a_row`: state.
[[nodiscard]] bool twins_differ(int& in_a_row, double a, double b, double most) noexcept;

/// True if `reading` is farther than `most` from the median of `others`; false without others.
[[nodiscard]] bool far_from_others(double reading, std::span<const double> others, double most);
/// The larger of both middle values if the number is even; NaN without values.
[[nodiscard]] double median_of(std::span<const double> values);

/// The last value that was used.
struct HeldValue {
  double value = std::numeric_limits<double>::quiet_NaN();
  std::chrono::nanoseconds at{};
};
/// `usable` if given, which is then held; else the held value for `hold_for` after its instant,
/// then NaN.
[[nodiscard]] double held_value(HeldValue& held, std::optional<double> usable,
                                std::chrono::nanoseconds at, std::chrono::nanoseconds hold_for);

}  // namespace abbe::calib

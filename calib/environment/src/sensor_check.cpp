#include "abbe/calib/environment/sensor_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "abbe/calib/environment/followed_value.hpp"
#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib {
namespace {

using std::chrono::nanoseconds;

constexpr double kIceInKelvin = 273.15;
constexpr std::array kPowerOnValues_C{85.0, 127.0, -127.0, 0.0};
/// Tolerance of the comparison: larger than the rounding of a register value times its scale,
/// smaller than the resolution of every sensor.
constexpr double kSameValue_K = 1e-4;
/// Duration of a doubt after which the tolerance has doubled. In this time a machine that warms up
/// by 10 K/h changes by 0.5 K, the default tolerance of a temperature.
constexpr std::chrono::minutes kToleranceDoubles{3};

double elapsed_seconds(nanoseconds d) noexcept {
  return std::chrono::duration<double>(d).count();
}

double tolerance_of(const SensorTrack& track, const SensorLimits& limits, nanoseconds at) {
  if (!track.doubted_since) return limits.tolerance;
  const double share =
      elapsed_seconds(at - *track.doubted_since) / elapsed_seconds(kToleranceDoubles);
  return limits.tolerance * (1.0 + std::clamp(share, 0.0, 1.0));
}

CheckedReading check_first(SensorTrack& track, const SensorLimits& limits, double reading,
                           nanoseconds at) {
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  if (limits.celsius_power_on_values && is_power_on_value(reading)) {
    track = {};
    return {SensorDoubt::PowerOnValue, nothing, nothing};
  }

  const bool agrees = track.agreed > 0 && std::abs(reading - track.reference) <= limits.tolerance;
  const CheckedReading expected{SensorDoubt::Unconfirmed,
                                track.agreed > 0 ? track.reference - limits.tolerance : nothing,
                                track.agreed > 0 ? track.reference + limits.tolerance : nothing};
  track.agreed = agrees ? track.agreed + 1 : 1;
  track.reference = reading;
  track.at = at;
  track.has_history = track.agreed >= limits.agreeing;
  if (track.has_history) return {};
  return agrees ? CheckedReading{SensorDoubt::Unconfirmed, nothing, nothing} : expected;
}

CheckedReading check_rate(SensorTrack& track, const SensorLimits& limits, double reading,
                          nanoseconds at) {
  const double elapsed_s = std::max(0.0, elapsed_seconds(at - track.at));
  const double possible = track.doubted_since ? track.slack : limits.most_per_s * elapsed_s;
  const double most = possible + tolerance_of(track, limits, at);
  const CheckedReading expected{SensorDoubt::Jump, track.reference - most, track.reference + most};
  track.at = std::max(track.at, at);

  if (std::abs(reading - track.reference) > most) {
    if (!track.doubted_since) track.doubted_since = at;
    track.slack = possible;
    return expected;
  }

  // At the end of a doubt the reading itself becomes the reference: it may differ from the old
  // reference by more than the change that was possible.
  const bool doubted = track.doubted_since.has_value();
  track.reference = doubted ? reading : moved_towards(track.reference, reading, possible);
  track.doubted_since.reset();
  return {SensorDoubt::None, expected.lowest, expected.highest};
}

}  // namespace

bool is_power_on_value(double temperature_K) noexcept {
  return std::ranges::any_of(kPowerOnValues_C, [&](double value_C) {
    return std::abs(temperature_K - kIceInKelvin - value_C) < kSameValue_K;
  });
}

CheckedReading check_reading(SensorTrack& track, const SensorLimits& limits, double reading,
                             nanoseconds at) {
  const bool known = track.has_history || track.agreed > 0;
  if (known && at - track.at > limits.forget_after) track = {};
  if (std::isnan(reading)) return {SensorDoubt::NoValue, limits.lowest, limits.highest};
  if (reading < limits.lowest || reading > limits.highest)
    return {SensorDoubt::OutOfRange, limits.lowest, limits.highest};
  return track.has_history ? check_rate(track, limits, reading, at)
                           : check_first(track, limits, reading, at);
}

bool twins_differ(int& in_a_row, double a, double b, double most) noexcept {
  constexpr int kConfirmed = 2;
  in_a_row = std::abs(a - b) > most ? std::min(in_a_row + 1, kConfirmed) : 0;
  return in_a_row >= kConfirmed;
}

double median_of(std::span<const double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::vector<double> ordered(values.begin(), values.end());
  return median(ordered);
}

bool far_from_others(double reading, std::span<const double> others, double most) {
  return !others.empty() && std::abs(reading - median_of(others)) > most;
}

double held_value(HeldValue& held, std::optional<double> usable, nanoseconds at,
                  nanoseconds hold_for) {
  if (usable) held = {*usable, at};
  return at - held.at <= hold_for ? held.value : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace abbe::calib

#pragma once
/// Temperature, pressure and humidity of the air on a shop floor, and the temperatures of scales
/// and parts. Each quantity is a mean plus a drift and a sinusoidal swing. Pure functions of the
/// time.

#include <array>
#include <cstddef>

#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

inline constexpr std::size_t kSimulatedInputs = 8;

/// Course of a quantity over the time t, in the unit of the quantity:
///   mean + drift * t + swing * sin(2 pi t / period)
struct Course {
  double mean = 0.0;
  double drift_per_hour = 0.0;
  double swing = 0.0;
  double swing_period_s = 600.0;
  [[nodiscard]] double at(std::chrono::nanoseconds since_start) const;
};

struct EnvironmentModel {
  Course air_temperature_C{20.0};
  Course air_pressure_hPa{1013.25};
  Course relative_humidity_percent{45.0};
  std::array<Course, kSimulatedInputs> temperature_C{Course{20.0}, Course{20.0}, Course{20.0},
                                                     Course{20.0}, Course{20.0}, Course{20.0},
                                                     Course{20.0}, Course{20.0}};
};

}  // namespace abbe::sim

#include "abbe/sim/environment_model.hpp"

#include <cmath>
#include <numbers>

namespace abbe::sim {

double Course::at(std::chrono::nanoseconds since_start) const {
  const double t_s = ns_to_seconds(since_start);
  return mean + drift_per_hour * t_s / 3600.0 +
         swing * std::sin(2.0 * std::numbers::pi * t_s / swing_period_s);
}

}  // namespace abbe::sim

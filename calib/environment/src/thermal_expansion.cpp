#include "abbe/calib/environment/thermal_expansion.hpp"

#include <cmath>

#include "abbe/calib/statistics/root_sum_of_squares.hpp"

namespace abbe::calib {

double expansion_factor(const Expansion& e) noexcept {
  return 1.0 + e.alpha_per_K * (e.temperature_K - kReferenceTemperature_K);
}

double u_expansion_factor(const Expansion& e) noexcept {
  return root_sum_of_squares((e.temperature_K - kReferenceTemperature_K) * e.u_alpha_per_K,
                             e.alpha_per_K * e.u_temperature_K);
}

UncertainLength true_position(double reading_m, double fixed_m, const Expansion& scale) noexcept {
  const double from_fixed_m = reading_m - fixed_m;
  return {fixed_m + from_fixed_m * expansion_factor(scale),
          std::abs(from_fixed_m) * u_expansion_factor(scale)};
}

}  // namespace abbe::calib

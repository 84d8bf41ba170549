#include "abbe/drivers/sampling/coverage.hpp"

#include <cmath>
#include <numbers>

namespace abbe::drivers {
namespace {

constexpr double kCoverage = 0.95;
constexpr double kNormal95 = 1.959963984540054;  // P(|N| <= 1.96 s) = 0.95
constexpr int kHalvings = 40;                    // 2^-40 of the bracket

/// The integral of the normal distribution function from minus infinity: x Phi(x) + phi(x).
double integral_of_phi(double x) noexcept {
  const double phi = std::exp(-0.5 * x * x) / std::sqrt(2.0 * std::numbers::pi);
  return x * 0.5 * std::erfc(-x / std::numbers::sqrt2) + phi;
}

/// P(|R + N| <= U) of expanded_95(), with all arguments in units of the standard deviation of N.
double probability_within(double U, double half_width) noexcept {
  const double one_side = integral_of_phi(U + half_width) - integral_of_phi(U - half_width);
  const double other = integral_of_phi(half_width - U) - integral_of_phi(-half_width - U);
  return (one_side - other) / (2.0 * half_width);
}

}  // namespace

double expanded_95(double half_width, double u_normal) ABBE_RT {
  // Beyond these ratios the smaller part changes the result by a relative 1e-5 at most.
  if (half_width <= 5e-3 * u_normal) return kNormal95 * u_normal;
  if (u_normal <= 1e-4 * half_width) return kCoverage * half_width;
  const double a = half_width / u_normal;
  double low = 0.0;
  double high = a + kNormal95;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (probability_within(middle, a) < kCoverage ? low : high) = middle;
  }
  return 0.5 * (low + high) * u_normal;
}

}  // namespace abbe::drivers

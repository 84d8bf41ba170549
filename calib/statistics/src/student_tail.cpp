#include "abbe/calib/internal/statistics/student_tail.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib {
namespace {

constexpr std::size_t kMostDof = 10'000;

/// 1 / B(k/2, 1/2) = Gamma((k + 1)/2) / (Gamma(k/2) Gamma(1/2)), from the values for k = 1 and k =
/// 2 and Gamma(a + 1) = a Gamma(a).
double inverse_beta(std::size_t k) noexcept {
  double value = k % 2 == 1 ? 1.0 / std::numbers::pi : 0.5;
  for (std::size_t i = k % 2 == 1 ? 1 : 2; i < k; i += 2) {
    value *= static_cast<double>(i + 1) / static_cast<double>(i);
  }
  return value;
}

/// Continued fraction of I_x(a, b) without its factor, by Lentz's method; converges fast for
/// x < (a + 1) / (a + b + 2).
double beta_fraction(double a, double b, double x) noexcept {
  constexpr double kConverged = 1e-15, kTiny = std::numeric_limits<double>::min() / kConverged;
  constexpr int kMostSteps = 10'000;
  const auto not_zero = [](double v) { return std::abs(v) < kTiny ? kTiny : v; };
  double c = 1.0, d = 1.0 / not_zero(1.0 - (a + b) * x / (a + 1.0)), fraction = d;

  for (int m = 1; m < kMostSteps; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    d = 1.0 / not_zero(1.0 + even * d);
    c = not_zero(1.0 + even / c);
    fraction *= d * c;
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    d = 1.0 / not_zero(1.0 + odd * d);
    c = not_zero(1.0 + odd / c);
    fraction *= d * c;
    if (std::abs(d * c - 1.0) < kConverged) {
      break;
    }
  }

  return fraction;
}

}  // namespace

double student_tail(double t, std::size_t dof) noexcept {
  if (std::isnan(t) || t == 0.0) {
    return std::isnan(t) ? t : 1.0;
  }
  if (std::isinf(t)) {
    return 0.0;
  }

  const std::size_t k = std::clamp<std::size_t>(dof, 1, kMostDof);
  const double n = static_cast<double>(k), a = 0.5 * n;
  const double x = n / (n + t * t), rest = t * t / (n + t * t);  // rest = 1 - x
  const double factor = exponential(a * natural_logarithm(x)) * std::sqrt(rest) * inverse_beta(k);
  return x < (a + 1.0) / (a + 2.5) ? factor * beta_fraction(a, 0.5, x) / a
                                   : 1.0 - factor * beta_fraction(0.5, a, rest) / 0.5;
}

double student_quantile(double p, std::size_t dof) noexcept {
  double low = 0.0, high = 1.0;
  while (student_tail(high, dof) > p) {
    low = high;
    high *= 2.0;
  }

  constexpr double kRelative = 1e-10;
  while (high - low > kRelative * high) {
    const double middle = 0.5 * (low + high);
    (student_tail(middle, dof) > p ? low : high) = middle;
  }
  return high;
}

double student_over_normal(double dof) noexcept {
  constexpr double z = 1.959964;
  constexpr std::array kT95{12.706205, 4.302653, 3.182446, 2.776445, 2.570582};
  if (dof < 5.5) {
    return kT95[static_cast<std::size_t>(std::lround(std::max(dof, 1.0))) - 1] / z;
  }
  constexpr double z2 = z * z;
  const double first = (z2 + 1) / (4 * dof);
  const double second = (5 * z2 * z2 + 16 * z2 + 3) / (96 * dof * dof);
  const double third = (3 * z2 * z2 * z2 + 19 * z2 * z2 + 17 * z2 - 15) / (384 * dof * dof * dof);
  return 1 + first + second + third;
}

}  // namespace abbe::calib

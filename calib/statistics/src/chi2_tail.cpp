#include "abbe/calib/internal/statistics/chi2_tail.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib {
namespace {

constexpr double kDigits = 1e-14;
constexpr int kMostTerms = 100'000;

/// ln Gamma(k/2), from Gamma(1/2) = sqrt(pi), Gamma(1) = 1 and Gamma(a + 1) = a Gamma(a).
double log_gamma_of_half(std::size_t k) noexcept {
  double sum = k % 2 == 0 ? 0.0 : 0.5 * natural_logarithm(std::numbers::pi);
  for (std::size_t twice = k % 2 == 0 ? 2 : 1; twice < k; twice += 2) {
    sum += natural_logarithm(0.5 * static_cast<double>(twice));
  }
  return sum;
}

/// The incomplete gamma function P(a, x) without its factor, for x < a + 1.
double lower_series(double a, double x) noexcept {
  double term = 1.0 / a, sum = term;
  for (int n = 1; n < kMostTerms && term > kDigits * sum; ++n) {
    term *= x / (a + n);
    sum += term;
  }
  return sum;
}

/// The incomplete gamma function Q(a, x) without its factor, for x >= a + 1, by Lentz's method.
double upper_fraction(double a, double x) noexcept {
  constexpr double kTiny = std::numeric_limits<double>::min() / kDigits;
  double b = x + 1.0 - a, c = 1.0 / kTiny, d = 1.0 / b, fraction = d;
  for (int i = 1; i < kMostTerms; ++i) {
    const double numerator = -i * (i - a);
    b += 2.0;
    d = 1.0 / (numerator * d + b);
    c = b + numerator / c;
    fraction *= d * c;
    if (std::abs(d * c - 1.0) < kDigits) {
      break;
    }
  }
  return fraction;
}

}  // namespace

double log_chi2_tail(double x, std::size_t k) noexcept {
  if (!(x > 0.0)) {
    return std::isnan(x) ? x : 0.0;
  }
  if (std::isinf(x)) {
    return -x;
  }

  const double a = 0.5 * static_cast<double>(k), half_x = 0.5 * x;
  const double log_factor = a * natural_logarithm(half_x) - half_x - log_gamma_of_half(k);
  if (half_x < a + 1.0) {
    return natural_logarithm(1.0 - exponential(log_factor) * lower_series(a, half_x));
  }
  return log_factor + natural_logarithm(upper_fraction(a, half_x));
}

}  // namespace abbe::calib

#include "abbe/calib/internal/statistics/elementary.hpp"

#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>

namespace abbe::calib {
namespace {

constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

// pi/2 and ln 2, each as a sum of parts. All parts but the last end in enough zero bits that their
// product with an integer of up to 20 bits is exact.
constexpr double kHalfPi_1 = 0x1.921fb544p+0, kHalfPi_2 = 0x1.0b4611a6p-34,
                 kHalfPi_3 = 0x1.3198a2e037073p-69;
constexpr double kLn2_1 = 0x1.62e42feep-1, kLn2_2 = 0x1.a39ef35793c76p-33;

/// The polynomial c[0] + c[1] z + c[2] z^2 ...
template <std::size_t n>
constexpr double polynomial(const std::array<double, n>& c, double z) noexcept {
  double sum = c[n - 1];
  for (std::size_t i = n - 1; i-- > 0;) sum = sum * z + c[i];
  return sum;
}

/// The n numbers 1/first!, 1/(first + step)!, 1/(first + 2 step)! and so on, with alternating signs
/// if `alternate` is -1.
template <std::size_t n>
constexpr std::array<double, n> inverse_factorials(int first, int step, double alternate) noexcept {
  std::array<double, n> c{};
  double sign = 1.0;
  for (std::size_t i = 0; i < n; ++i, sign *= alternate) {
    double factorial = 1.0;  // exact up to 22!
    for (int k = 2; k <= first + step * static_cast<int>(i); ++k) factorial *= k;
    c[i] = sign / factorial;
  }
  return c;
}

// Coefficients of the Taylor series in the parentheses:
//     sin r = r - r^3 (1/3! - r^2/5! ...),   cos r = 1 - r^2/2 + r^4 (1/4! - r^2/6! ...)
// The first omitted term of each series is below 1e-18.
constexpr auto kSine = inverse_factorials<8>(3, 2, -1.0);
constexpr auto kCosine = inverse_factorials<8>(4, 2, -1.0);
// Coefficients of the Taylor series in the parentheses:
//     e^r = 1 + r + r^2 (1/2! + r/3! ...)
constexpr auto kExponential = inverse_factorials<13>(2, 1, 1.0);

/// The coefficients 2/3, 2/5, 2/7 and so on of the series in the parentheses:
///     log((1 + s)/(1 - s)) = 2 s + s z (2/3 + z 2/5 ...),   z = s^2.
constexpr std::array<double, 11> odd_fractions() noexcept {
  std::array<double, 11> c{};
  for (std::size_t i = 0; i < c.size(); ++i) c[i] = 2.0 / static_cast<double>(2 * i + 3);
  return c;
}
constexpr auto kLogarithm = odd_fractions();

/// Sine and cosine of r + rest, |r| <= pi/4, |rest| below half a unit in the last place of r.
SinCos of_reduced(double r, double rest) noexcept {
  const double z = r * r, half_z = 0.5 * z;
  const double sine_tail = rest * (1.0 - half_z) - r * z * polynomial(kSine, z);
  const double cosine = 1.0 - half_z;
  const double cosine_tail = (1.0 - cosine - half_z) + (z * z * polynomial(kCosine, z) - r * rest);
  return {r + sine_tail, cosine + cosine_tail};
}

}  // namespace

SinCos sin_cos(double angle_rad) noexcept {
  constexpr double kLargest_rad = 1e6;
  if (!(std::abs(angle_rad) <= kLargest_rad)) return {kNotANumber, kNotANumber};
  const double quarters = std::floor(angle_rad * (2.0 / std::numbers::pi) + 0.5);
  const double first = angle_rad - quarters * kHalfPi_1;  // both exact
  const double second = quarters * kHalfPi_2;             // exact product
  const double difference = first - second;
  const double lost = (first - difference) - second - quarters * kHalfPi_3;
  const double r = difference + lost;
  const SinCos of_rest = of_reduced(r, (difference - r) + lost);

  switch (static_cast<std::int64_t>(quarters) & 3) {
    case 0:
      return of_rest;
    case 1:
      return {of_rest.cos, -of_rest.sin};
    case 2:
      return {-of_rest.sin, -of_rest.cos};
    default:
      return {-of_rest.cos, of_rest.sin};
  }
}

double exponential(double x) noexcept {
  if (std::isnan(x)) return x;
  if (x > 709.0) return std::numeric_limits<double>::infinity();
  if (x < -708.0) return 0.0;
  const double twos = std::floor(x / std::numbers::ln2 + 0.5);
  const double first = x - twos * kLn2_1;  // both exact
  const double second = twos * kLn2_2;
  const double r = first - second;
  const double rest = (first - r) - second;
  const double above_one = r + (r * r * polynomial(kExponential, r) + rest * (1.0 + r));
  return std::ldexp(1.0 + above_one, static_cast<int>(twos));
}

double natural_logarithm(double x) noexcept {
  if (!std::isnormal(x) || x < 0.0) return kNotANumber;
  int twos = 0;
  double fraction = std::frexp(x, &twos);

  if (fraction < 0.5 * std::numbers::sqrt2) {
    fraction *= 2.0;
    --twos;
  }

  const double f = fraction - 1.0;  // exact difference
  const double s = f / (2.0 + f);
  const double z = s * s;
  const double half_square = 0.5 * f * f;

  // 2 s = f - f^2/2 + s f^2/2 for s = f / (2 + f). In this form the largest term, f, has no
  // rounding error.
  const double tail = s * (half_square + z * polynomial(kLogarithm, z));
  return twos * kLn2_1 - ((half_square - (tail + twos * kLn2_2)) - f);
}

double power(double x, int n) noexcept {
  double product = 1.0;
  for (int i = 0; i < std::abs(n); ++i) product *= x;
  return n < 0 ? 1.0 / product : product;
}

double NormalDeviates::next() {
  if (has_second_) {
    has_second_ = false;
    return second_;
  }
  const double radius = std::sqrt(-2.0 * natural_logarithm(uniform()));
  const SinCos direction = sin_cos(2.0 * std::numbers::pi * uniform());
  second_ = radius * direction.sin;
  has_second_ = true;
  return radius * direction.cos;
}

}  // namespace abbe::calib

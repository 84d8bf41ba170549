/// Compared with the C library in extended precision, 64 bits on x86-64.
#include "abbe/calib/internal/statistics/elementary.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

namespace {
using namespace abbe::calib;

/// Difference of `value` from the exact value in units of the last place.
double units_off(double value, long double right) {
  const double last_place = std::nextafter(std::abs(value), INFINITY) - std::abs(value);
  return static_cast<double>(std::abs(static_cast<long double>(value) - right)) / last_place;
}

/// The maximum over a million arguments.
double most(double low, double high, const std::function<double(double)>& off) {
  std::mt19937_64 random(1);
  double worst = 0.0;
  for (int i = 0; i < 1'000'000; ++i) {
    const double part = static_cast<double>(random() >> 11) * 0x1p-53;
    worst = std::max(worst, off(low + part * (high - low)));
  }
  return worst;
}

TEST(Elementary, SineAndCosineAreWithinAUnitOfTheLastPlace) {
  EXPECT_LT(
      most(-0.78, 0.78, [](double x) { return units_off(sin_cos(x).sin, std::sin(1.0L * x)); }),
      0.9);
  EXPECT_LT(
      most(-0.78, 0.78, [](double x) { return units_off(sin_cos(x).cos, std::cos(1.0L * x)); }),
      0.9);
}

/// Beyond one quarter turn the argument is reduced; near the zeros the unit of the error is that of
/// 1.
TEST(Elementary, SineAndCosineHoldForManyTurns) {
  const auto off = [](double x) {
    const SinCos s = sin_cos(x);
    return static_cast<double>(
        std::max(std::abs(s.sin - std::sin(1.0L * x)), std::abs(s.cos - std::cos(1.0L * x))));
  };
  EXPECT_LT(most(-7.0, 7.0, off), 0x1p-53);
  EXPECT_LT(most(-1e6, 1e6, off), 0x1p-53);
}

TEST(Elementary, TheQuartersAreExactToTheirRounding) {
  const SinCos half = sin_cos(0x1.921fb54442d18p+1), quarter = sin_cos(0x1.921fb54442d18p+0);
  EXPECT_EQ(half.cos, -1.0);
  EXPECT_NEAR(half.sin, 1.2246467991473532e-16, 1e-31);  // pi minus its nearest double
  EXPECT_EQ(quarter.sin, 1.0);
  EXPECT_NEAR(quarter.cos, 6.123233995736766e-17, 1e-32);
}

TEST(Elementary, SineOfZeroKeepsItAndBeyondTheRangeThereIsNone) {
  EXPECT_EQ(sin_cos(0.0).sin, 0.0);
  EXPECT_EQ(sin_cos(0.0).cos, 1.0);
  for (const double x : {1.1e6, -1e300, double{INFINITY}, double{NAN}}) {
    EXPECT_TRUE(std::isnan(sin_cos(x).sin)) << x;
    EXPECT_TRUE(std::isnan(sin_cos(x).cos)) << x;
  }
}

TEST(Elementary, TheExponentialIsWithinAUnitOfTheLastPlace) {
  EXPECT_LT(
      most(-700.0, 700.0, [](double x) { return units_off(exponential(x), std::exp(1.0L * x)); }),
      1.0);
  EXPECT_LT(most(-1.0, 1.0, [](double x) { return units_off(exponential(x), std::exp(1.0L * x)); }),
            1.0);
}

TEST(Elementary, TheExponentialEndsInZeroAndInfinity) {
  EXPECT_EQ(exponential(0.0), 1.0);
  EXPECT_EQ(exponential(-1000.0), 0.0);
  EXPECT_EQ(exponential(1000.0), std::numeric_limits<double>::infinity());
  EXPECT_TRUE(std::isnan(exponential(NAN)));
}

TEST(Elementary, TheLogarithmIsWithinAUnitOfTheLastPlace) {
  const auto off = [](double x) { return units_off(natural_logarithm(x), std::log(1.0L * x)); };
  EXPECT_LT(most(0.5, 2.0, off), 1.0);
  EXPECT_LT(most(1e-12, 1e-3, off), 1.0);
  EXPECT_LT(most(1e3, 1e12, off), 1.0);
}

TEST(Elementary, TheLogarithmIsOfPositiveNumbers) {
  EXPECT_EQ(natural_logarithm(1.0), 0.0);
  for (const double x : {0.0, -1.0, double{INFINITY}, double{NAN}})
    EXPECT_TRUE(std::isnan(natural_logarithm(x))) << x;
}

TEST(Elementary, PowersAreProducts) {
  EXPECT_EQ(power(3.0, 4), 81.0);
  EXPECT_EQ(power(2.0, 0), 1.0);
  EXPECT_EQ(power(2.0, -2), 0.25);
}

/// Moments of a million values, each within five of its standard deviations.
TEST(NormalDeviates, HaveTheMomentsOfTheNormalDistribution) {
  constexpr double n = 1e6;
  NormalDeviates normal(3);
  double sum[5] = {}, product = 0.0, before = 0.0;

  for (int i = 0; i < 1'000'000; ++i) {
    const double z = normal.next();
    for (int k = 1; k <= 4; ++k) sum[k] += power(z, k);
    product += z * before;
    before = z;
  }

  EXPECT_NEAR(sum[1] / n, 0.0, 5 * std::sqrt(1 / n));
  EXPECT_NEAR(sum[2] / n, 1.0, 5 * std::sqrt(2 / n));
  EXPECT_NEAR(sum[3] / n, 0.0, 5 * std::sqrt(15 / n));
  EXPECT_NEAR(sum[4] / n, 3.0, 5 * std::sqrt(96 / n));
  EXPECT_NEAR(product / n, 0.0, 5 * std::sqrt(1 / n));  // neighbouring values are independent
}

}  // namespace

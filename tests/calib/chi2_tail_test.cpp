#include "abbe/calib/internal/statistics/chi2_tail.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace abbe::calib {
namespace {

/// Closed forms: erfc(sqrt(x/2)) for one degree of freedom, e^(-x/2) sum_(i<k/2) (x/2)^i/i! for an
/// even number.
double closed_form(double x, std::size_t k) {
  if (k == 1) {
    return std::erfc(std::sqrt(0.5 * x));
  }
  double term = 1.0, sum = 1.0;
  for (std::size_t i = 1; i < k / 2; ++i) {
    term *= 0.5 * x / static_cast<double>(i);
    sum += term;
  }
  return std::exp(-0.5 * x) * sum;
}

TEST(Chi2Tail, AgreesWithTheClosedForms) {
  for (const std::size_t k : {1u, 2u, 4u, 12u, 60u}) {
    for (const double x : {0.01, 0.7, 3.0, 11.0, 45.0, 130.0, 600.0}) {
      const double wanted = std::log(closed_form(x, k));
      EXPECT_NEAR(log_chi2_tail(x, k), wanted, 1e-11 * (1.0 + std::abs(wanted))) << k << " " << x;
    }
  }
}

/// Q(k) of neighbouring odd k: Q(a + 1, h) = Q(a, h) + h^a e^-h / Gamma(a + 1).
TEST(Chi2Tail, ObeysTheRecursionForOddNumbers) {
  for (const double x : {0.5, 8.0, 40.0}) {
    const double h = 0.5 * x;
    for (std::size_t k = 1; k < 31; k += 2) {
      const double a = 0.5 * static_cast<double>(k);
      const double step = std::exp(a * std::log(h) - h - std::lgamma(a + 1.0));
      EXPECT_NEAR(std::exp(log_chi2_tail(x, k + 2)), std::exp(log_chi2_tail(x, k)) + step, 1e-12);
    }
  }
}

TEST(Chi2Tail, IsFiniteForVeryLargeValues) {
  EXPECT_NEAR(log_chi2_tail(1e6, 2), -5e5, 1e-6);
  EXPECT_EQ(log_chi2_tail(std::numeric_limits<double>::infinity(), 3),
            -std::numeric_limits<double>::infinity());
}

TEST(Chi2Tail, IsOneForZeroAndNaNForNaN) {
  EXPECT_EQ(log_chi2_tail(0.0, 5), 0.0);
  EXPECT_TRUE(std::isnan(log_chi2_tail(std::numeric_limits<double>::quiet_NaN(), 5)));
}

}  // namespace
}  // namespace abbe::calib

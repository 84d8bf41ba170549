#include "abbe/calib/internal/statistics/student_tail.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace abbe::calib {
namespace {

/// Closed forms for one, two and three degrees of freedom.
double student_closed_form(double t, std::size_t dof) {
  const double angle = std::atan(t / std::sqrt(static_cast<double>(dof)));
  switch (dof) {
    case 1:
      return 1.0 - 2.0 / std::numbers::pi * angle;
    case 2:
      return 1.0 - std::sin(angle);
    default:
      return 1.0 - 2.0 / std::numbers::pi * (angle + std::sin(angle) * std::cos(angle));
  }
}

TEST(StudentTail, AgreesWithTheClosedForms) {
  for (const std::size_t dof : {1u, 2u, 3u}) {
    for (const double t : {0.01, 0.5, 1.0, 2.0, 4.0, 9.0, 30.0}) {
      EXPECT_NEAR(student_tail(t, dof), student_closed_form(t, dof), 1e-13) << dof << " " << t;
      EXPECT_EQ(student_tail(-t, dof), student_tail(t, dof));
    }
  }
}

/// [GUM] table G.2, 95 %; the table has two decimals: 0.005 of t change p by at most 0.5 %.
TEST(StudentTail, AgreesWithTheTableOfTheGum) {
  constexpr double kDof[] = {1, 2, 4, 10, 50}, kT95[] = {12.71, 4.30, 2.78, 2.23, 2.01};
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(student_tail(kT95[i], static_cast<std::size_t>(kDof[i])), 0.05, 5e-4) << kDof[i];
  }
}

/// The difference to the normal distribution is of the order t^4 / dof.
TEST(StudentTail, TendsToTheNormalDistribution) {
  for (const double t : {0.3, 1.96, 4.0}) {
    const double normal = std::erfc(t / std::sqrt(2.0));
    EXPECT_NEAR(student_tail(t, 1'000'000) / normal, 1.0, 0.01) << t;
  }
}

TEST(StudentTail, HasLimits) {
  EXPECT_EQ(student_tail(0.0, 4), 1.0);
  EXPECT_EQ(student_tail(std::numeric_limits<double>::infinity(), 4), 0.0);
  EXPECT_TRUE(std::isnan(student_tail(std::nan(""), 4)));
}

TEST(StudentQuantile, InvertsTheTail) {
  for (const std::size_t dof : {1u, 2u, 12u, 1000u}) {
    for (const double p : {0.5, 0.05, 1e-4}) {
      EXPECT_NEAR(student_tail(student_quantile(p, dof), dof) / p, 1.0, 1e-8) << dof << " " << p;
    }
  }
  EXPECT_NEAR(student_quantile(0.05, 1) / std::tan(0.475 * std::numbers::pi), 1.0, 1e-9);
}

}  // namespace
}  // namespace abbe::calib

#include "abbe/calib/internal/sparse/penalty.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "sparse_solution.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::sparse;
using namespace abbe::tests::sparse;

constexpr double kLambda = 0.7;
constexpr std::array kEveryPenalty{Penalty{PenaltyKind::Lasso, 0}, Penalty{PenaltyKind::Mcp, 1.5},
                                   Penalty{PenaltyKind::Mcp, 3.0}, Penalty{PenaltyKind::Scad, 2.2},
                                   Penalty{PenaltyKind::Scad, 3.7}};

double objective_of_one(const Penalty& penalty, double z, double b) {
  return (z - b) * (z - b) / 2 + value(penalty, kLambda, std::abs(b));
}

TEST(SparsePenalty, MinimiserIsBelowEveryOtherCoefficient) {
  for (const Penalty& penalty : kEveryPenalty) {
    for (double z = -4.0; z <= 4.0; z += 0.13) {
      const double best = objective_of_one(penalty, z, minimiser(penalty, kLambda, z));
      for (double b = -5.0; b <= 5.0; b += 0.01) {
        ASSERT_LE(best, objective_of_one(penalty, z, b) + 1e-14)
            << name(penalty.kind) << ' ' << penalty.gamma << " z " << z << " b " << b;
      }
    }
  }
}

TEST(SparsePenalty, DerivativeIsTheSlopeOfTheValue) {
  // the penalties are piecewise quadratic: central differences are exact to rounding
  constexpr double kStep = 1e-6;
  for (const Penalty& penalty : kEveryPenalty) {
    for (double t = 0.005; t < 4.0; t += 0.01) {
      const double slope =
          (value(penalty, kLambda, t + kStep) - value(penalty, kLambda, t - kStep)) / (2 * kStep);
      ASSERT_NEAR(derivative(penalty, kLambda, t), slope, 1e-6)
          << name(penalty.kind) << " at " << t;
    }
  }
}

TEST(SparsePenalty, ConcavityIsTheSteepestFallOfTheDerivative) {
  for (const Penalty& penalty : kEveryPenalty) {
    double steepest = 0.0;
    for (double t = 0.0; t < 4.0; t += 0.01) {
      steepest = std::max(
          steepest,
          (derivative(penalty, kLambda, t) - derivative(penalty, kLambda, t + 1e-4)) / 1e-4);
    }
    EXPECT_NEAR(concavity(penalty), steepest, 1e-9) << name(penalty.kind);
  }
}

TEST(SparsePenalty, RefusesGammaOutOfRange) {
  EXPECT_EQ(check({PenaltyKind::Scad, 2.0}).error().code, ErrorCode::BadInput);
  EXPECT_EQ(check({PenaltyKind::Mcp, 1.0}).error().code, ErrorCode::BadInput);
  EXPECT_EQ(check({PenaltyKind::Scad, std::nan("")}).error().code, ErrorCode::NotFinite);
}

TEST(SparsePenalty, TheLassoHasNoGamma) {
  EXPECT_TRUE(check({PenaltyKind::Lasso, -1.0}));
}

}  // namespace

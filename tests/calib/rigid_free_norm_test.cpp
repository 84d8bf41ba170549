/// Size of V without rigid motion.
#include "abbe/calib/internal/geometry/rigid_free_norm.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "abbe/calib/internal/model/certainty.hpp"

namespace {
using namespace abbe::calib;

/// Two coefficients at four points: a rigid motion (all along X) and a stretch along X of 1 m per
/// m.
struct FourPoints {
  std::vector<Vector3> points_m{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  Eigen::MatrixXd D = Eigen::MatrixXd::Zero(12, 2);
  FourPoints() {
    for (Eigen::Index i = 0; i < 4; ++i) {
      D(3 * i, 0) = 1.0;
      D(3 * i, 1) = points_m[static_cast<std::size_t>(i)].x();
    }
  }
};

TEST(RigidFreeNorm, IsZeroForARigidMotion) {
  const FourPoints p;
  EXPECT_NEAR(RigidFreeNorm(p.D, p.points_m).rms_m(Eigen::Vector2d(3.0, 0.0)), 0.0, 1e-7);
}

TEST(RigidFreeNorm, CountsAStretchWithoutItsRigidPart) {
  const FourPoints p;
  const double rms_m = RigidFreeNorm(p.D, p.points_m).rms_m(Eigen::Vector2d(0.0, 1.0));
  EXPECT_GT(rms_m, 0.1);
  EXPECT_LT(rms_m, std::sqrt(3.0) / 4.0 + 1e-9);  // upper limit: removal of the mean alone
}

TEST(RigidFreeNorm, WhatIsNotANumberStaysSoAndIsRefused) {
  const FourPoints p;
  const RigidFreeNorm norm(p.D, p.points_m);
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(norm.rms_m(Eigen::Vector2d(kNaN, 1.0))));
  EXPECT_TRUE(std::isnan(norm.rms_of_columns_m(Eigen::Matrix2d::Constant(kNaN))));
  EXPECT_TRUE(std::isnan(norm.rms_u_m(Eigen::Matrix2d::Constant(kNaN))));
  Verdict verdict;
  require_certainty(verdict, 1e-4, kNaN);
  EXPECT_EQ(verdict.reasons.size(), 1u);
}

}  // namespace

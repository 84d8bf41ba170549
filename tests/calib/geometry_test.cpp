#include "abbe/calib/geometry/rigid_transform.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

namespace {
using namespace abbe::calib;

const std::vector<Vector3> kPoints{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0.3, 0.2, 3}};

std::vector<Vector3> moved(const RigidTransform& T) {
  std::vector<Vector3> to;
  for (const Vector3& p : kPoints) {
    to.push_back(T * p);
  }
  return to;
}

TEST(RigidFit, FindsTheMotionOfExactPoints) {
  const RigidTransform T{Eigen::AngleAxisd(2.5, Vector3(1, 2, 3).normalized()).toRotationMatrix(),
                         {4, -5, 6}};
  const Result<RigidTransform> fit = fit_rigid(kPoints, moved(T));
  ASSERT_TRUE(fit);
  EXPECT_LT((fit->R - T.R).norm(), 1e-14);
  EXPECT_LT((fit->t_m - T.t_m).norm(), 1e-13);
}

TEST(RigidFit, NeverReflects) {
  std::vector<Vector3> mirrored = kPoints;
  for (Vector3& p : mirrored) {
    p.z() = -p.z();
  }
  const Result<RigidTransform> fit = fit_rigid(kPoints, mirrored);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->R.determinant(), 1.0, 1e-14);
}

TEST(RigidFit, RefusesPointsOnALine) {
  const std::vector<Vector3> line{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
  const Result<RigidTransform> fit = fit_rigid(line, line);
  ASSERT_FALSE(fit);
  EXPECT_EQ(fit.error().code, ErrorCode::DegenerateGeometry);
}

TEST(RotationEffect, IsTheCrossProduct) {
  const Vector3 r(1, -2, 3), p(4, 5, -6);
  EXPECT_LT((rotation_effect(p) * r - r.cross(p)).norm(), 1e-15);
}

TEST(Spherical, TurnsRangeAzimuthElevationIntoAPoint) {
  const Vector3 p = from_spherical(2.0, 0.5, -0.3);
  EXPECT_NEAR(p.norm(), 2.0, 1e-15);
  EXPECT_NEAR(std::atan2(p.y(), p.x()), 0.5, 1e-15);
  EXPECT_NEAR(std::asin(p.z() / 2.0), -0.3, 1e-15);
}

}  // namespace

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "abbe/calib/fit/plane.hpp"
#include "abbe/calib/fit/sphere.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::fit;

std::vector<Vector3> on_sphere(const Vector3& centre, double radius, double sigma, unsigned seed,
                               int count = 25) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Vector3> points;
  for (int i = 0; i < count; ++i) {
    const Vector3 away =
        Vector3(normal(random), normal(random), std::abs(normal(random))).normalized();
    points.push_back(centre + (radius + sigma * normal(random)) * away);
  }
  return points;
}

std::vector<Vector3> on_plane(const Vector3& point, const Vector3& normal_direction, double sigma,
                              unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const Vector3 n = normal_direction.normalized(), a = n.unitOrthogonal(), b = n.cross(a);
  std::vector<Vector3> points;
  for (int i = -2; i <= 2; ++i) {
    for (int j = -2; j <= 2; ++j) {
      points.push_back(point + 0.01 * i * a + 0.005 * j * b + sigma * normal(random) * n);
    }
  }
  return points;
}

TEST(SphereFit, FindsAnExactSphereFarAway) {
  const Vector3 centre(1000, -700, 400);
  const auto sphere = fit_sphere(on_sphere(centre, 10, 0.0, 1));
  ASSERT_TRUE(sphere) << sphere.error().text;
  EXPECT_LT((sphere->centre - centre).norm(), 1e-11);  // the coordinates are accurate to 1e-13
  EXPECT_NEAR(sphere->radius, 10, 1e-11);
  EXPECT_EQ(sphere->residuals.degrees_of_freedom, 21u);
}

TEST(SphereFit, IsStationaryInTheDistances) {
  const auto points = on_sphere({0.1, 0.2, 0.3}, 0.0127, 1e-4, 2);
  const auto sphere = fit_sphere(points);
  ASSERT_TRUE(sphere);
  Eigen::Vector4d gradient = Eigen::Vector4d::Zero();
  double squares = 0;

  for (const Vector3& p : points) {
    const Vector3 away = p - sphere->centre;
    const double r = away.norm() - sphere->radius;
    gradient.head<3>() -= r * away.normalized();
    gradient(3) -= r;
    squares += r * r;
  }

  EXPECT_LT(gradient.norm(), 1e-12 * 25 * sphere->radius);
  EXPECT_NEAR(sphere->residuals.rms, std::sqrt(squares / 25), 1e-15);
}

TEST(SphereFit, StatesItsUncertainty) {
  const Vector3 centre(0.1, 0.2, 0.3);
  constexpr int kRuns = 2000;
  Eigen::Vector4d squares = Eigen::Vector4d::Zero();

  // The same points in every run, with different noise.
  const auto places = on_sphere(centre, 0.0127, 0.0, 5);
  std::mt19937 random(6);
  std::normal_distribution<double> noise(0, 3e-6);
  Eigen::Matrix4d stated = Eigen::Matrix4d::Zero();

  for (int run = 0; run < kRuns; ++run) {
    auto points = places;
    for (Vector3& p : points) {
      p += noise(random) * (p - centre).normalized();
    }
    const auto sphere = fit_sphere(points);
    ASSERT_TRUE(sphere);
    Eigen::Vector4d off;
    off << sphere->centre - centre, sphere->radius - 0.0127;
    squares += off.cwiseAbs2() / kRuns;
    stated += sphere->covariance / kRuns;
  }

  for (Eigen::Index i = 0; i < 4; ++i) {
    // 2000 runs determine a variance to 3 %.
    EXPECT_NEAR(squares(i) / stated(i, i), 1.0, 0.12) << i;
  }
}

TEST(SphereFit, RefusesWhatIsNoSphere) {
  const auto points = on_sphere({0, 0, 0}, 1, 0.0, 3, 12);
  EXPECT_EQ(fit_sphere(std::span(points).first(3)).error().code, ErrorCode::TooFewObservations);
  std::vector<Vector3> repeated(10, points[0]);
  repeated[1] = points[1];
  repeated[2] = points[2];
  EXPECT_EQ(fit_sphere(repeated).error().code, ErrorCode::TooFewObservations);
  std::vector<Vector3> circle;

  for (int i = 0; i < 12; ++i) {
    circle.emplace_back(std::cos(i * 0.5), std::sin(i * 0.5), 2.0);
  }

  EXPECT_EQ(fit_sphere(circle).error().code, ErrorCode::DegenerateGeometry);
  auto broken = points;
  broken[4].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(fit_sphere(broken).error().code, ErrorCode::NotFinite);
  EXPECT_EQ(fit_sphere({}).error().code, ErrorCode::TooFewObservations);
}

TEST(SphereFit, TakesFourPointsWithoutRedundancy) {
  const auto points = on_sphere({1, 2, 3}, 2, 0.0, 8, 4);
  const auto sphere = fit_sphere(points);
  ASSERT_TRUE(sphere) << sphere.error().text;
  EXPECT_NEAR(sphere->radius, 2, 1e-10);
  EXPECT_EQ(sphere->residuals.degrees_of_freedom, 0u);
  EXPECT_EQ(sphere->residuals.sigma0, 0.0);
}

TEST(PlaneFit, FindsAnExactPlaneOnTheAskedSide) {
  const Vector3 n = Vector3(0.6, 0.8, 0).normalized();
  const auto points = on_plane({100, 200, 300}, n, 0.0, 1);
  const auto there = fit_plane(points, Vector3(1, 1, 0)),
             back = fit_plane(points, Vector3(-1, -1, 0));
  ASSERT_TRUE(there && back);
  EXPECT_LT((there->normal - n).norm(), 1e-11);  // 1e-13 of coordinates over 0.01 of extent
  EXPECT_LT((back->normal + n).norm(), 1e-11);
}

TEST(PlaneFit, StatesItsUncertainty) {
  const Vector3 n = Vector3(0.1, -0.2, 1).normalized();
  constexpr int kRuns = 2000;
  Matrix3 seen = Matrix3::Zero(), stated = Matrix3::Zero();
  for (unsigned run = 0; run < kRuns; ++run) {
    const auto plane = fit_plane(on_plane({1, 2, 3}, n, 3e-6, run), Vector3::UnitZ());
    ASSERT_TRUE(plane);
    seen += (plane->normal - n) * (plane->normal - n).transpose() / kRuns;
    stated += plane->cov_normal / kRuns;
  }
  EXPECT_LT((seen - stated).norm(), 0.12 * stated.norm());
}

TEST(PlaneFit, RefusesWhatIsNoPlane) {
  std::vector<Vector3> line;
  for (int i = 0; i < 5; ++i) {
    line.emplace_back(i, 2 * i, 3 * i);
  }
  EXPECT_EQ(fit_plane(line, Vector3::UnitZ()).error().code, ErrorCode::DegenerateGeometry);
  EXPECT_EQ(fit_plane(std::span(line).first(2), Vector3::UnitZ()).error().code,
            ErrorCode::TooFewObservations);
  const auto points = on_plane(Vector3::Zero(), Vector3::UnitZ(), 0.0, 1);
  EXPECT_EQ(fit_plane(points, Vector3::UnitX()).error().code, ErrorCode::DegenerateGeometry);
}

}  // namespace

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>

#include "abbe/calib/fit/cylinder.hpp"
#include "abbe/calib/fit/plane.hpp"
#include "abbe/calib/fit/sphere.hpp"
#include "abbe/calib/internal/fit/circle.hpp"
#include "abbe/calib/internal/fit/line.hpp"

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

/// Mean of squared errors and of the stated covariance over many fits of the same places with
/// noise.
template <int Size>
struct SeenAndStated {
  using Square = Eigen::Matrix<double, Size, Size>;
  Square seen = Square::Zero(), stated = Square::Zero();

  void add(const Eigen::Matrix<double, Size, 1>& error, const Square& covariance) {
    seen += error * error.transpose();
    stated += covariance;
  }
  /// 2000 fits determine a variance to 3 %.
  void expect_equal() const { EXPECT_LT((seen - stated).norm(), 0.12 * stated.norm()); }
};

constexpr int kFits = 2000;
constexpr double kTouchNoise = 3e-3;

TEST(CircleFit, StatesItsUncertainty) {
  std::mt19937 random(11);
  std::normal_distribution<double> noise(0, kTouchNoise);
  const Eigen::Vector2d centre(100, -50);
  SeenAndStated<3> compared;
  for (int fit = 0; fit < kFits; ++fit) {
    std::vector<Eigen::Vector2d> points;
    for (int i = 0; i < 9; ++i) {  // an arc of 160 degrees
      const Eigen::Vector2d away(std::cos(0.35 * i), std::sin(0.35 * i));
      points.emplace_back(centre + (8 + noise(random)) * away);
    }
    const auto circle = fit_circle(points);
    ASSERT_TRUE(circle) << circle.error().text;
    compared.add({circle->centre.x() - 100, circle->centre.y() + 50, circle->radius - 8},
                 circle->covariance);
  }
  compared.expect_equal();
}

TEST(CircleFit, RefusesWhatIsNoCircle) {
  std::vector<Eigen::Vector2d> line{{0, 0}, {1, 2}, {2, 4}, {5, 10}};
  EXPECT_EQ(fit_circle(line).error().code, ErrorCode::DegenerateGeometry);
  EXPECT_EQ(fit_circle(std::span(line).first(2)).error().code, ErrorCode::TooFewObservations);
  line[1].x() = std::numeric_limits<double>::infinity();
  EXPECT_EQ(fit_circle(line).error().code, ErrorCode::NotFinite);
}

TEST(LineFit, StatesItsUncertainty) {
  std::mt19937 random(12);
  std::normal_distribution<double> noise(0, kTouchNoise);
  const Vector3 d = Vector3(1, 2, -2) / 3, a = d.unitOrthogonal(), b = d.cross(a);
  const Vector3 middle(10, 20, 30);
  SeenAndStated<3> of_point, of_direction;
  for (int fit = 0; fit < kFits; ++fit) {
    std::vector<Vector3> points;
    for (int i = -3; i <= 3; ++i) {
      points.emplace_back(middle + 5 * i * d + noise(random) * a + noise(random) * b);
    }
    const auto line = fit_line(points, Vector3::UnitX());
    ASSERT_TRUE(line) << line.error().text;
    of_point.add(line->point - middle, line->cov_point);
    of_direction.add(line->direction - d, line->cov_direction);
  }
  of_point.expect_equal();
  of_direction.expect_equal();
}

TEST(LineFit, RefusesWhatIsNoLine) {
  const std::vector<Vector3> square{{1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  EXPECT_EQ(fit_line(square, Vector3::UnitX()).error().code, ErrorCode::DegenerateGeometry);
  EXPECT_EQ(fit_line(std::span(square).first(1), Vector3::UnitX()).error().code,
            ErrorCode::TooFewObservations);
  EXPECT_EQ(fit_line(std::span(square).first(2), Vector3::UnitZ()).error().code,
            ErrorCode::DegenerateGeometry);
}

/// Touched places of a cylinder: `sections` of `around` points each, over `arc_rad`.
std::vector<Vector3> on_cylinder(const Cylinder& c, int sections, int around, double arc_rad,
                                 const std::function<double()>& noise) {
  const Vector3 a = c.direction.unitOrthogonal(), b = c.direction.cross(a);
  std::vector<Vector3> points;
  for (int s = 0; s < sections; ++s) {
    for (int i = 0; i < around; ++i) {
      const double angle = 0.3 + arc_rad * i / around;
      points.emplace_back(c.point + 6.0 * (s - 0.5 * (sections - 1)) * c.direction +
                          (c.radius + noise()) * (std::cos(angle) * a + std::sin(angle) * b));
    }
  }
  return points;
}

TEST(CylinderFit, StatesItsUncertainty) {
  std::mt19937 random(13);
  std::normal_distribution<double> normal(0, kTouchNoise);
  Cylinder truth;
  truth.point = Vector3(100, 200, -300);
  truth.direction = Vector3(0.6, 0, 0.8);
  truth.radius = 8;
  SeenAndStated<7> compared;
  for (int fit = 0; fit < kFits; ++fit) {
    const auto points = on_cylinder(truth, 3, 4, 6.2832, [&] { return normal(random); });
    const auto c = fit_cylinder(points, Vector3(0.5, 0.1, 0.9));
    ASSERT_TRUE(c) << c.error().text;
    Eigen::Matrix<double, 7, 1> error;
    const Vector3 off = c->point - truth.point;  // along the axis the point is that of the centroid
    error << off - off.dot(truth.direction) * truth.direction, c->direction - truth.direction,
        c->radius - truth.radius;
    compared.add(error, c->covariance);
  }
  compared.expect_equal();
  // The angles are small beside the lengths and hardly count in the norm of all.
  SeenAndStated<3> of_direction;
  of_direction.seen = compared.seen.block<3, 3>(3, 3);
  of_direction.stated = compared.stated.block<3, 3>(3, 3);
  of_direction.expect_equal();
}

TEST(CylinderFit, TakesFivePointsWithoutRedundancy) {
  Cylinder truth;
  truth.radius = 5;
  auto points = on_cylinder(truth, 2, 3, 6.2832, [] { return 0.0; });
  points.pop_back();
  const auto c = fit_cylinder(points, Vector3(0.05, 0, 1));
  ASSERT_TRUE(c) << c.error().text;
  EXPECT_NEAR(c->radius, 5, 1e-10);
  EXPECT_EQ(c->residuals.degrees_of_freedom, 0u);
  EXPECT_EQ(c->covariance.norm(), 0.0);
  EXPECT_GT(fit_cylinder(points, Vector3(0, 0, 1), 1e-3)->covariance.norm(), 0.0);
}

TEST(CylinderFit, RefusesPointsThatLeaveItOpen) {
  Cylinder truth;
  truth.radius = 5;
  const auto two_lines = on_cylinder(truth, 4, 2, 6.2832, [] { return 0.0; });
  EXPECT_EQ(fit_cylinder(two_lines, Vector3(Vector3::UnitZ())).error().code,
            ErrorCode::DegenerateGeometry);

  auto four_in_one_section = on_cylinder(truth, 1, 4, 6.2832, [] { return 0.0; });
  four_in_one_section.emplace_back(3, 4, 8);
  const auto open = fit_cylinder(four_in_one_section, Vector3(Vector3::UnitZ()));
  ASSERT_FALSE(open);
  EXPECT_EQ(open.error().code, ErrorCode::DegenerateGeometry);
  EXPECT_NE(open.error().text.find("do not determine"), std::string::npos) << open.error().text;

  const auto points = on_cylinder(truth, 3, 4, 6.2832, [] { return 0.0; });
  EXPECT_EQ(fit_cylinder(points, Vector3(Vector3::Zero())).error().code, ErrorCode::BadInput);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(fit_cylinder(points, Vector3(nan, 0, 1)).error().code, ErrorCode::NotFinite);
}

}  // namespace

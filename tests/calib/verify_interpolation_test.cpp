#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "abbe/calib/geometry/validity_volume.hpp"
#include "abbe/calib/internal/verify/interpolation.hpp"

namespace abbe::calib::verify {
namespace {

std::vector<Vector3> scattered(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> x(-0.1, 0.8), y(-0.1, 0.4), z(-0.04, 0.08);
  std::vector<Vector3> points(count);
  for (Vector3& p : points) p = {x(random), y(random), z(random)};
  return points;
}

std::vector<Vector3> lattice() {
  std::vector<Vector3> points;
  for (int i = 0; i < 5; ++i)
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < 3; ++k) points.emplace_back(0.1 * i, 0.1 * j, 0.02 * k);
  return points;
}

Vector3 place_of(const LinearWeights& w, const std::vector<Vector3>& points) {
  Vector3 p = Vector3::Zero();
  for (std::size_t k = 0; k < 4; ++k) p += w.weight[k] * points[w.point[k]];
  return p;
}

void expect_weights_make_the_places(const std::vector<Vector3>& points,
                                    const std::vector<Vector3>& places) {
  const auto hull = *ValidityVolume::hull_of(points);
  const auto weights = *linear_weights(points, places);
  for (std::size_t i = 0; i < places.size(); ++i) {
    ASSERT_EQ(weights[i].has_value(), hull.contains(places[i])) << i;
    if (weights[i]) {
      EXPECT_LT((place_of(*weights[i], points) - places[i]).norm(), 1e-9) << i;
    }
  }
}

TEST(LinearWeights, MakeEveryPlaceInsideTheHullAndNoneOutside) {
  expect_weights_make_the_places(scattered(60, 1), scattered(300, 2));
}

TEST(LinearWeights, TakeLatticesWithAllTheirTies) {
  auto places = scattered(300, 3);
  const auto points = lattice();
  places.insert(places.end(), points.begin(), points.end());
  for (const Vector3& p : points)
    places.emplace_back(p + Vector3(0.05, 0.05, 0.01));  // middles of the cells
  expect_weights_make_the_places(points, places);
}

TEST(LinearWeights, AreThePointItselfAtAPoint) {
  const auto points = scattered(60, 4);
  const auto weights = *linear_weights(points, points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    double own = 0.0;
    for (std::size_t k = 0; k < 4; ++k)
      own += weights[i]->point[k] == i ? weights[i]->weight[k] : 0.0;
    EXPECT_NEAR(own, 1.0, 1e-9) << i;
  }
}

/// The definition: no other point lies in the sphere through the corners (coordinates scaled to the
/// bounding box).
TEST(LinearWeights, ComeFromTheDelaunayTriangulation) {
  const auto points = scattered(60, 5), places = scattered(100, 6);
  Vector3 low = points[0], high = points[0];
  for (const Vector3& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }

  const auto scaled = [&](const Vector3& p) -> Vector3 {
    return (p - low).cwiseQuotient(high - low);
  };

  const auto weights = *linear_weights(points, places);
  for (const auto& w : weights) {
    if (!w) continue;
    Matrix3 A;
    Vector3 b;
    const Vector3 p0 = scaled(points[w->point[0]]);
    for (Eigen::Index k = 0; k < 3; ++k) {
      const Vector3 p = scaled(points[w->point[static_cast<std::size_t>(k) + 1]]);
      A.row(k) = 2.0 * (p - p0).transpose();
      b(k) = p.squaredNorm() - p0.squaredNorm();
    }
    const Vector3 centre = A.fullPivLu().solve(b);
    for (const Vector3& p : points)
      EXPECT_GE((scaled(p) - centre).norm(), (p0 - centre).norm() - 1e-7);
  }
}

TEST(LinearWeights, NeedAVolume) {
  std::vector<Vector3> flat = scattered(20, 7);
  for (Vector3& p : flat) p.z() = 0.5 * p.x() - p.y();
  EXPECT_EQ(linear_weights(flat, flat).error().code, ErrorCode::DegenerateGeometry);
  EXPECT_EQ(linear_weights(std::span(flat).first(3), flat).error().code,
            ErrorCode::TooFewObservations);
}

}  // namespace
}  // namespace abbe::calib::verify

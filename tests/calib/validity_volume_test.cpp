#include "abbe/calib/validity_volume.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <random>

namespace {
using namespace abbe::calib;

std::vector<Vector3> lattice() {
  std::vector<Vector3> points;
  for (const double x : {-0.3, 0.0, 0.3}) {
    for (const double y : {-0.25, 0.0, 0.25}) {
      for (const double z : {-0.4, -0.2, 0.0}) {
        points.emplace_back(x, y, z);
      }
    }
  }
  return points;
}

TEST(ValidityVolume, OfALatticeIsItsBox) {
  const Result<ValidityVolume> volume = ValidityVolume::hull_of(lattice());
  ASSERT_TRUE(volume) << volume.error().text;
  EXPECT_EQ(volume->vertices_m().size(), 8u);
  EXPECT_TRUE(volume->contains({0.3, 0.25, -0.4}));
  EXPECT_TRUE(volume->contains({0.1, -0.2, -0.1}));
  EXPECT_FALSE(volume->contains({0.301, 0.0, -0.2}));
}

TEST(ValidityVolume, OfATetrahedronEndsAtItsFaces) {
  const std::vector<Vector3> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const Result<ValidityVolume> volume = ValidityVolume::hull_of(corners);
  ASSERT_TRUE(volume);
  EXPECT_TRUE(volume->contains({0.33, 0.33, 0.33}));
  EXPECT_FALSE(volume->contains({0.34, 0.34, 0.34}));
}

TEST(ValidityVolume, ContainsEveryPointItWasMadeOf) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  std::vector<Vector3> points;
  for (int i = 0; i < 80; ++i) {
    points.emplace_back(normal(random), normal(random), normal(random));
  }
  const Result<ValidityVolume> volume = ValidityVolume::hull_of(points);
  ASSERT_TRUE(volume);
  for (const Vector3& p : points) {
    EXPECT_TRUE(volume->contains(p));
  }
  EXPECT_LT(volume->vertices_m().size(), points.size());
}

TEST(ValidityVolume, CanBeMadeAgainFromItsVertices) {
  const ValidityVolume volume = *ValidityVolume::hull_of(lattice());
  const ValidityVolume again = *ValidityVolume::hull_of(volume.vertices_m());
  EXPECT_TRUE(again.contains({0.2999, 0.2499, -0.0001}));
  EXPECT_FALSE(again.contains({0.2999, 0.2502, -0.0001}));
}

TEST(ValidityVolume, SeesTheBumpOnATiltedPlate) {
  std::vector<Vector3> points;
  for (int i = 0; i <= 10; ++i) {
    for (int j = 0; j <= 10; ++j) {
      const double x = 0.1 * i, y = 0.1 * j;
      const bool bump = i == 5 && j == 5;
      points.emplace_back(x, y, 0.3 * x + 0.7 * y + (bump ? 0.05 : 0.0));
    }
  }
  const Result<ValidityVolume> volume = ValidityVolume::hull_of(points);
  ASSERT_TRUE(volume) << volume.error().text;
  EXPECT_TRUE(volume->contains({0.5, 0.5, 0.549}));
  EXPECT_FALSE(volume->contains({0.5, 0.5, 0.551}));
}

TEST(ValidityVolume, OfALongPathAroundABoxIsThatBox) {
  std::vector<Vector3> points;
  const std::vector<Vector3> corners{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                     {0, 1, 1}, {1, 1, 1}, {1, 0, 1}, {0, 0, 1}};
  for (std::size_t leg = 0; leg + 1 < corners.size(); ++leg) {
    for (int i = 0; i < 1000; ++i) {
      points.push_back(corners[leg] + 1e-3 * i * (corners[leg + 1] - corners[leg]));
    }
  }
  points.push_back(corners.back());
  const Result<ValidityVolume> volume = ValidityVolume::hull_of(points);
  ASSERT_TRUE(volume) << volume.error().text;
  EXPECT_EQ(volume->vertices_m().size(), 8u);
}

TEST(ValidityVolume, RefusesAFlatOne) {
  const std::vector<Vector3> flat{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.5, 0.2, 0}};
  const Result<ValidityVolume> volume = ValidityVolume::hull_of(flat);
  ASSERT_FALSE(volume);
  EXPECT_EQ(volume.error().code, ErrorCode::DegenerateGeometry);
}

TEST(ValidityVolume, OfNothingContainsNothing) {
  EXPECT_FALSE(ValidityVolume().contains(Vector3::Zero()));
}

TEST(SpreadSubset, LosesNoSide) {
  std::vector<Vector3> sphere;
  constexpr int kPoints = 2000;
  for (int i = 0; i < kPoints; ++i) {  // a spiral, as even as points on a sphere get
    const double z = 1.0 - (2.0 * i + 1.0) / kPoints, turn = 2.399963 * i, r = std::sqrt(1.0 - z * z);
    sphere.emplace_back(z, r * std::cos(turn), r * std::sin(turn));
  }
  const std::vector<Vector3> some = spread_subset(sphere, 512);
  ASSERT_EQ(some.size(), 512u);
  // No place of the sphere is farther from the subset than a few times the distance of 512 even points.
  double farthest = 0.0;
  for (const Vector3& p : sphere) {
    double nearest = 2.0;
    for (const Vector3& s : some) {
      nearest = std::min(nearest, (p - s).norm());
    }
    farthest = std::max(farthest, nearest);
  }
  EXPECT_LT(farthest, 0.2);
  EXPECT_EQ(spread_subset(sphere, 2000).size(), 2000u);
}

}  // namespace

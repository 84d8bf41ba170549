#include "abbe/calib/geometry/validity_volume.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <random>
#include <vector>

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

/// A corner 2 um above the middle of a face of 0.3 m.
TEST(ValidityVolume, KeepsAnApexJustAboveAFace) {
  for (const double height_m : {2e-6, 10e-6, 50e-6}) {
    std::vector<Vector3> points{
        {0, 0, 0}, {0.3, 0, 0}, {0, 0.3, 0}, {0.3, 0.3, 0}, {0.15, 0.15, -0.2}};
    points.emplace_back(0.15, 0.15, height_m);
    const ValidityVolume live = *ValidityVolume::hull_of(points);
    const ValidityVolume stored = *ValidityVolume::of_vertices(live.vertices_m());
    EXPECT_EQ(live.vertices_m().size(), 6u);
    EXPECT_TRUE(live.contains(points.back()));
    EXPECT_TRUE(stored.contains(points.back()));
    EXPECT_FALSE(stored.contains({0.15, 0.15, height_m + 1.1e-6}));
  }
}

enum class Shape { Sphere, Lattice, OnCube, Wavy };
constexpr double kSide_m = 0.3;

/// 150 points, randomly rotated and flattened: many of them coplanar or nearly coplanar.
std::vector<Vector3> points_of(Shape shape, double flat, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_int_distribution<int> step(0, 4), axis(0, 2);
  const Matrix3 R =
      Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
          .normalized()
          .toRotationMatrix();
  std::vector<Vector3> points;

  for (int i = 0; i < 150; ++i) {
    Vector3 p(normal(random), normal(random), normal(random));
    if (shape == Shape::Sphere) {
      p.normalize();
    } else if (shape == Shape::OnCube) {
      p(axis(random)) = step(random) < 2 ? -1.0 : 1.0;
      p = p.cwiseMax(-1.0).cwiseMin(1.0);
    } else {
      p = Vector3(step(random), step(random),
                  shape == Shape::Wavy ? 1e-2 * normal(random) : step(random)) /
          4;
    }
    p.z() *= flat;
    points.push_back(kSide_m * (R * p));
  }

  return points;
}

TEST(ValidityVolume, ContainsTheSameAfterItWasStored) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::size_t differ = 0, inside = 0, tried = 0;

  for (const Shape shape : {Shape::Sphere, Shape::Lattice, Shape::OnCube, Shape::Wavy}) {
    for (const double flat : {1.0, 1.0, 1e-2, 1e-4, 1e-5}) {
      const std::vector<Vector3> points = points_of(shape, flat, random);
      const ValidityVolume live = *ValidityVolume::hull_of(points);
      const ValidityVolume stored = *ValidityVolume::of_vertices(live.vertices_m());
      for (int i = 0; i < 1000; ++i) {  // close to a point, most of them at the boundary
        const double away_m = i % 2 == 0 ? 1e-6 : 1e-3;
        const Vector3 q = points[static_cast<std::size_t>(i) % points.size()] +
                          away_m * Vector3(normal(random), normal(random), normal(random));
        differ += live.contains(q) != stored.contains(q) ? 1 : 0;
        inside += live.contains(q) ? 1 : 0;
        ++tried;
      }
    }
  }

  EXPECT_EQ(differ, 0u);
  EXPECT_GT(inside, tried / 20);
  EXPECT_LT(inside, tried / 20 * 19);
}

/// Planes through three points with all others on one side, by brute force.
bool in_brute_force_hull(const std::vector<Vector3>& points, const Vector3& q, double tolerance_m) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      for (std::size_t k = 0; k < j; ++k) {
        const Vector3 n = (points[j] - points[i]).cross(points[k] - points[i]).normalized();
        const auto height = [&](const Vector3& p) { return n.dot(p - points[i]); };
        double low = 0.0, high = 0.0;
        for (const Vector3& p : points) {
          low = std::min(low, height(p));
          high = std::max(high, height(p));
        }
        if ((high < 1e-12 && height(q) > tolerance_m) ||
            (low > -1e-12 && height(q) < -tolerance_m)) {
          return false;
        }
      }
    }
  }

  return true;
}

TEST(ValidityVolume, IsTheHullThatBruteForceFinds) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  for (const Shape shape : {Shape::Sphere, Shape::Lattice, Shape::OnCube, Shape::Wavy}) {
    std::vector<Vector3> points = points_of(shape, 1.0, random);
    points.resize(24);
    const ValidityVolume volume = *ValidityVolume::hull_of(points);
    for (const Vector3& p : points) {
      EXPECT_TRUE(volume.contains(p));
    }
    for (int i = 0; i < 20; ++i) {
      const Vector3 q = 0.12 * Vector3(normal(random), normal(random), normal(random));
      EXPECT_EQ(volume.contains(q), in_brute_force_hull(points, q, ValidityVolume::kTolerance_m));
    }
  }
}

TEST(ValidityVolume, OfPointsOnItsFacesHasTheCornersOfTheCubeOnly) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> place(-1.0, 1.0);
  const Matrix3 R = Eigen::AngleAxisd(0.4, Vector3(1, 2, 3).normalized()).toRotationMatrix();
  std::vector<Vector3> points;

  for (int i = 0; i < 1000; ++i) {
    Vector3 p(place(random), place(random), place(random));
    p(i % 3) = i % 2 == 0 ? 1.0 : -1.0;
    points.emplace_back(kSide_m * (R * p));
  }

  for (int corner = 0; corner < 8; ++corner) {
    const Vector3 p((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                    (corner & 4) != 0 ? 1 : -1);
    points.emplace_back(kSide_m * (R * p));
  }

  EXPECT_EQ(ValidityVolume::hull_of(points)->vertices_m().size(), 8u);
}

TEST(ValidityVolume, OfFiveThousandVerticesTakesNoTime) {
  std::mt19937_64 random(6);
  std::normal_distribution<double> normal;
  std::vector<Vector3> points;

  for (int i = 0; i < 5000; ++i) {
    points.push_back(kSide_m *
                     Vector3(normal(random), normal(random), normal(random)).normalized());
  }

  const std::clock_t before = std::clock();
  const Result<ValidityVolume> volume = ValidityVolume::hull_of(points);
  const double cpu_s = static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
  EXPECT_EQ(volume->vertices_m().size(), points.size());
  EXPECT_LT(cpu_s,
            // measured 0.07 s, ten times that with a sanitizer; an n^3 algorithm takes half an hour
            5.0);
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
  constexpr int kSpiralPoints = 2000;
  for (int i = 0; i < kSpiralPoints; ++i) {  // a spiral: nearly uniform points on a sphere
    const double z = 1.0 - (2.0 * i + 1.0) / kSpiralPoints, turn = 2.399963 * i,
                 r = std::sqrt(1.0 - z * z);
    sphere.emplace_back(z, r * std::cos(turn), r * std::sin(turn));
  }

  const std::vector<Vector3> some = spread_subset(sphere, 512);
  ASSERT_EQ(some.size(), 512u);

  // Every point of the sphere is nearer to the subset than a few times the spacing of 512 uniform
  // points.
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

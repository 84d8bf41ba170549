#include "abbe/calib/fit/points_off.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace abbe::calib::fit {
namespace {

/// Readings in a volume of 600 mm, and what a tracker with 5 um noise measures there.
struct MeasuredPlaces {
  std::vector<Vector3> readings_m, measured_m;

  explicit MeasuredPlaces(std::size_t n, unsigned seed = 1) : random(seed) {
    const RigidTransform T{
        Eigen::AngleAxisd(1.1, Vector3(0.2, 0.1, 1.0).normalized()).toRotationMatrix(),
        Vector3(0.9, 0.5, 0.2)};
    std::uniform_real_distribution<double> place(-0.3, 0.3);
    std::normal_distribution<double> noise(0.0, 5e-6);
    for (std::size_t i = 0; i < n; ++i) {
      const Vector3 q(place(random), place(random), place(random));
      readings_m.push_back(q);
      measured_m.emplace_back(T * q + Vector3(noise(random), noise(random), noise(random)));
    }
  }
  [[nodiscard]] std::vector<std::size_t> found() const {
    std::vector<std::size_t> points;
    for (const PointOff& off : points_off(measured_m, readings_m).points)
      points.push_back(off.point);
    return points;
  }
  std::mt19937 random;
};

using PointNumbers = std::vector<std::size_t>;

TEST(PointsOff, AreSentinelsAndWrongDigits) {
  for (const Vector3& wrong_m : {Vector3(0, 0, 0), Vector3(-9.999, -9.999, -9.999),
                                 Vector3(1e27, 1e27, 1e27), Vector3(-1e3, 0, 0)}) {
    MeasuredPlaces m(60);
    m.measured_m[7] = wrong_m;
    EXPECT_EQ(m.found(), PointNumbers{7}) << wrong_m.transpose();
  }
  MeasuredPlaces m(60);
  m.measured_m[7].x() += 0.5e-3;
  const PointsOff off = points_off(m.measured_m, m.readings_m);
  ASSERT_EQ(off.points.size(), 1u);
  EXPECT_EQ(off.points[0].point, 7u);
  EXPECT_NEAR(off.points[0].distance_m, 0.5e-3, 20e-6);  // noise, and the fit of the others
  EXPECT_NEAR(off.rms_others_m, std::sqrt(3.0) * 5e-6, 2e-6);
}

TEST(PointsOff, AreNotThoseOfOrdinarySize) {
  MeasuredPlaces m(60);
  m.measured_m[7].x() += 0.5e-3;
  EXPECT_EQ(points_off(m.measured_m, m.readings_m, 0.4e-3).points.size(), 1u);
  EXPECT_TRUE(points_off(m.measured_m, m.readings_m, 0.6e-3).points.empty());
}

TEST(PointsOff, AreNotTheInnocentOnes) {
  for (unsigned seed = 1; seed <= 200; ++seed)
    for (const std::size_t n : {4u, 6u, 7u, 10u, 60u})
      EXPECT_EQ(MeasuredPlaces(n, seed).found(), PointNumbers{}) << n << " points, seed " << seed;
}

TEST(PointsOff, AreNotTheCornersOfAMachineWithErrors) {
  MeasuredPlaces m(200);
  for (std::size_t i = 0; i < m.readings_m.size(); ++i) {
    const Vector3& q = m.readings_m[i];  // straightness and a scale error of 100 um
    m.measured_m[i] += 1e-3 * Vector3(q.x() * q.x(), q.x() * q.y(), q.z() * q.z() * q.z() / 0.3);
  }
  EXPECT_EQ(m.found(), PointNumbers{});
}

TEST(PointsOff, AreFoundWhenThereAreTwo) {
  for (const Vector3& second_m : {Vector3(0, 0, 0), Vector3(2.0, 0, 0), Vector3(0, 0, -9.999)}) {
    MeasuredPlaces m(60);
    m.measured_m[7] = Vector3::Zero();
    m.measured_m[30] = second_m;
    EXPECT_EQ(m.found(), (PointNumbers{7, 30})) << second_m.transpose();
  }
  MeasuredPlaces m(60);
  m.measured_m[7].x() += 0.5e-3;
  m.measured_m[30].y() -= 0.4e-3;
  EXPECT_EQ(m.found(), (PointNumbers{7, 30}));
}

TEST(PointsOff, AreFoundAmongSix) {
  for (unsigned seed = 1; seed <= 50; ++seed) {
    MeasuredPlaces m(6, seed);
    m.measured_m[2] += Vector3(0, 0.1, 0);
    EXPECT_EQ(m.found(), PointNumbers{2}) << "seed " << seed;
  }
}

TEST(PointsOff, AreNotNamedWhenManyDoNotFit) {
  MeasuredPlaces m(20);
  for (std::size_t i = 0; i < 10; ++i) std::swap(m.measured_m[i], m.measured_m[19 - i]);
  EXPECT_EQ(m.found(), PointNumbers{});
  EXPECT_EQ(points_off({}, {}).points.size(), 0u);
}

}  // namespace
}  // namespace abbe::calib::fit

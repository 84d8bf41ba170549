#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "abbe/calib/probe/qualification.hpp"

namespace abbe::calib::probe {
namespace {

constexpr double kSphere_m = 12.5e-3;
const Vector3 kCentre_m{0.31, -0.12, 0.05};

/// A kinematic seat: three lobes about z that vanish at the pole, and a stylus that bends sideways.
double true_radius_m(const Vector3& n) {
  const double lobes = n[0] * n[0] * n[0] - 3.0 * n[0] * n[1] * n[1];
  return 2e-3 - 4e-6 + 1.5e-6 * lobes - 2e-6 * (1.0 - n[2] * n[2]);
}

/// The pole and rings of 12, evenly from an elevation of `lowest_rad` upwards; a stylus reaches
/// down to -0.3 at most.
std::vector<Vector3> directions(double lowest_rad, int rings) {
  std::vector<Vector3> all = {Vector3::UnitZ()};
  for (int ring = 0; ring < rings; ++ring) {
    const double elevation = lowest_rad + (std::numbers::pi / 2.0 - lowest_rad) * ring / rings;
    for (int k = 0; k < 12; ++k) {
      const double azimuth = 2.0 * std::numbers::pi * (k + 0.5 * (ring % 2)) / 12.0;
      all.emplace_back(std::cos(elevation) * std::cos(azimuth),
                       std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    }
  }
  return all;
}

std::vector<QualifyingTouch> touches(const std::vector<Vector3>& normals, double sigma_m,
                                     std::mt19937& random) {
  std::normal_distribution<double> noise{0.0, 1.0};
  std::vector<QualifyingTouch> out;
  for (const Vector3& n : normals)
    out.push_back({kCentre_m + (kSphere_m + true_radius_m(n) + sigma_m * noise(random)) * n, n});
  return out;
}

TEST(ProbeQualification, FindsRadiusLobesAndCentreWithoutNoise) {
  std::mt19937 random(1);
  const auto normals = directions(-0.3, 5);
  const auto q = qualify(touches(normals, 0.0, random));
  ASSERT_TRUE(q) << q.error().text;
  RecordProperty("condition", std::to_string(q->condition));
  EXPECT_LT((q->centre_m - kCentre_m).norm(), 1e-11);
  for (const Vector3& n : normals) EXPECT_NEAR(q->map.at(n).radius_m, true_radius_m(n), 1e-11);
  EXPECT_NEAR(q->lobing_m, 3.5e-6, 0.5e-6);  // 0 at the pole, -3.1 um in the lowest ring
}

/// With the mean radius alone, errors of micrometres would remain.
TEST(ProbeQualification, PredictsDirectionsThatWereNotTouched) {
  std::mt19937 random(2);
  const auto q = qualify(touches(directions(-0.3, 5), 0.1e-6, random));
  ASSERT_TRUE(q);
  for (const Vector3& n : directions(-0.2, 7)) {
    EXPECT_NEAR(q->map.at(n).radius_m, true_radius_m(n), 5 * q->map.at(n).u_m);
    EXPECT_LT(q->map.at(n).u_m, 0.5e-6);
  }
}

TEST(ProbeQualification, StatesItsUncertainty) {
  std::mt19937 random(3);
  const auto normals = directions(-0.3, 5);
  int held = 0;
  int intervals = 0;
  double sigma2 = 0.0;
  constexpr int kRuns = 300;

  for (int run = 0; run < kRuns; ++run) {
    const auto q = qualify(touches(normals, 0.25e-6, random));
    ASSERT_TRUE(q);
    sigma2 += q->sigma_m * q->sigma_m / kRuns;
    for (std::size_t i = 0; i < normals.size(); i += 7) {
      const auto r = q->map.at(normals[i]);
      held += std::abs(r.radius_m - true_radius_m(normals[i])) <= 1.96 * r.u_m ? 1 : 0;
      ++intervals;
    }
  }

  const double covered = static_cast<double>(held) / intervals;
  RecordProperty("covered", std::to_string(covered));
  EXPECT_GE(covered, 0.92);
  EXPECT_LE(covered, 0.97);
  EXPECT_NEAR(std::sqrt(sigma2), 0.25e-6, 0.02e-6);
}

TEST(ProbeQualification, CarriesTheUncertaintyOfTheSphereIntoTheRadius) {
  std::mt19937 random(4);
  const auto q = qualify(touches(directions(-0.3, 5), 0.0, random), {.u_sphere_radius_m = 0.3e-6});
  ASSERT_TRUE(q);
  EXPECT_NEAR(q->map.at(Vector3::UnitX()).u_m, 0.3e-6, 1e-9);
}

TEST(ProbeQualification, RefusesACapThatCannotTellLobingFromTheCentre) {
  std::mt19937 random(5);
  const auto q = qualify(touches(directions(1.2, 5), 0.1e-6, random));
  ASSERT_FALSE(q);
  EXPECT_EQ(q.error().code, ErrorCode::DegenerateGeometry);
}

TEST(ProbeQualification, RefusesTooFewTouchesAndBadOnes) {
  std::mt19937 random(6);
  EXPECT_EQ(qualify(touches(directions(-0.3, 1), 0.0, random)).error().code,
            ErrorCode::TooFewObservations);
  auto some = touches(directions(-0.3, 5), 0.0, random);
  some[5].normal.setZero();
  EXPECT_EQ(qualify(some).error().code, ErrorCode::BadInput);
  some[5].p_m[1] = std::nan("");
  EXPECT_EQ(qualify(some).error().code, ErrorCode::NotFinite);
}

}  // namespace
}  // namespace abbe::calib::probe

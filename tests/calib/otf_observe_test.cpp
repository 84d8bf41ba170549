#include "abbe/calib/otf/observe/observe.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "abbe/calib/internal/otf/identify/observe_run.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::HasSubstr;

const Noise kNoise{2e-6, 3e-6};

TEST(PathFrame, IsRightHandedWithA2TowardsTheBeam) {
  const PathFrame f = path_frame({0.3, -0.2, 0.5}, {1.0, 0.4, 0.1}, kNoise);
  EXPECT_LT((f.a1.cross(f.a2) - f.a3).norm(), 1e-15);
  EXPECT_NEAR(f.a1.dot(f.a2), 0, 1e-15);
  EXPECT_GT(f.a2.dot(Vector3(1.0, 0.4, 0.1)), 0);
  EXPECT_NEAR(f.a3.dot(Vector3(1.0, 0.4, 0.1)), 0, 1e-15);
}

/// Covariance of one sample: diag(sigma_r^2, (sigma_a / cos el)^2, sigma_a^2) of range, azimuth and
/// elevation, propagated with the Jacobian J of the position. [Sanders 2023] eq. (8) to (10), with
/// angles in place of the lengths of eq. (8).
Matrix3 sample_covariance_m2(const Vector3& p_m, const Noise& noise) {
  const double r = p_m.norm(), az = std::atan2(p_m.y(), p_m.x()), el = std::asin(p_m.z() / r);
  Matrix3 J;
  J << std::cos(el) * std::cos(az), -r * std::cos(el) * std::sin(az),
      -r * std::sin(el) * std::cos(az), std::cos(el) * std::sin(az),
      r * std::cos(el) * std::cos(az), -r * std::sin(el) * std::sin(az), std::sin(el), 0,
      r * std::cos(el);
  const double sa = noise.sigma_angle_rad;
  const Vector3 variance(noise.sigma_range_m * noise.sigma_range_m, std::pow(sa / std::cos(el), 2),
                         sa * sa);
  return J * variance.asDiagonal() * J.transpose();
}

TEST(PathFrame, HasTheUncertaintyOfTheCovarianceAlongItsAxes) {
  const Vector3 beam(1.0, 0.4, 0.1);
  const PathFrame f = path_frame({0.3, -0.2, 0.5}, beam, kNoise);
  const Matrix3 C = sample_covariance_m2(beam, kNoise);
  EXPECT_NEAR(f.sigma2_m, std::sqrt(f.a2.dot(C * f.a2)), 1e-18);
  EXPECT_NEAR(f.sigma3_m, std::sqrt(f.a3.dot(C * f.a3)), 1e-18);
  EXPECT_NEAR(f.a2.dot(C * f.a3), 0, 1e-24);  // a diagonal weight matrix is the optimal one
}

TEST(PathFrame, AlongTheBeamIsAnyPerpendicularPair) {
  const PathFrame f = path_frame({0, 0, 2}, {0, 1e-9, 1.5}, kNoise);
  EXPECT_NEAR(f.a2.norm(), 1, 1e-15);
  EXPECT_NEAR(f.a1.dot(f.a2), 0, 1e-15);
  EXPECT_NEAR(f.sigma2_m, 4.5e-6, 1e-12);
}

/// A segment that crosses a node: its row is the mean of the rows, not the row of the mean.
TEST(DesignRows, AreAveragedOverTheSegment) {
  const Machine machine = case_a_machine();
  Observations o{.basis = *TableBasis::of(layout_of(machine)),
                 .target_offset_m = machine.target_offset_m};
  const std::vector<Vector3> sub{
      {0.045, 0.1, -0.1}, {0.049, 0.1, -0.1}, {0.053, 0.1, -0.1}, {0.057, 0.1, -0.1}};
  PointOnPath point;
  point.axis_position_m = {0.051, 0.1, -0.1};
  point.frame = path_frame(Vector3::UnitX(), {1, 1, 0.5}, kNoise);
  append_rows(o, point, sub);
  ASSERT_EQ(o.rows.size(), 2u);
  Eigen::VectorXd U = case_a_tables(TableColumn::Truth);
  Vector3 mean = Vector3::Zero();

  for (const Vector3& q : sub) {
    mean +=
        volumetric_error(o.layout(), {U.data(), o.basis.size()}, q, machine.target_offset_m) / 4.0;
  }

  U.conservativeResizeLike(Eigen::VectorXd::Zero(169));
  for (std::size_t i = 0; i < 2; ++i) {
    double predicted = 0;
    for (const SparseRows::Entry& e : o.A.row(i)) {
      predicted += e.value * U(static_cast<Eigen::Index>(e.column));
    }
    EXPECT_NEAR(predicted, o.rows[i].direction.dot(mean), 1e-18);
  }

  const Vector3 at_mean = volumetric_error(o.layout(), {U.data(), o.basis.size()},
                                           point.axis_position_m, machine.target_offset_m);
  EXPECT_GT((at_mean - mean).norm(), 0.1e-6);  // the error of a row at the mean
}

TEST(Observe, DividesTheNoiseByTheSamplesOfASegment) {
  const MadeRun run = make_run({});
  const auto o = observe(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(o) << o.error().text;
  ASSERT_EQ(o->rows.size(), 2 * o->segments_used);
  const Observation& across = o->rows[1];
  const RigidTransform& T = o->alignment.T_machine_tracker;
  const double range_m = (across.axis_position_m + run.machine.target_offset_m - T.t_m).norm();
  EXPECT_NEAR(across.sigma_m, run.noise.sigma_angle_rad * range_m / std::sqrt(10.0),
              1e-3 * across.sigma_m);
}

TEST(Observe, RefusesSegmentsThatStraddleCorners) {
  MadeRun run = make_run({});
  run.options.segment_samples = 100;  // 160 mm at 0.4 m/s
  const auto o = observe(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_FALSE(o);
  EXPECT_THAT(o.error().text, HasSubstr("use at most 12"));
}

/// A tracker of few points per second: every `keep`-th sample of the run.
MadeRun slow_run(std::size_t keep) {
  MadeRun run = make_run({});
  std::vector<TrackerObservation> samples;
  for (std::size_t i = 0; i < run.samples.size(); i += keep) {
    samples.push_back(run.samples[i]);
  }
  run.samples = std::move(samples);
  run.options.segment_samples = suitable_segment_samples(run.samples);
  return run;
}

TEST(Observe, TakesPointsSixteenMillimetresApart) {
  const MadeRun run = slow_run(10);
  const Result<Observations> o =
      observe(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(o) << o.error().text;
  EXPECT_GT(o->segments_used, o->segments / 2);
}

TEST(Observe, RefusesPointsTooFarApartWithTheFactorNeeded) {
  const MadeRun run = slow_run(15);
  const Result<Observations> o =
      observe(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_FALSE(o);
  EXPECT_THAT(o.error().text, HasSubstr("points are 23.9"));
  EXPECT_THAT(o.error().text, HasSubstr("1.2 times as many points per second"));
}

TEST(Observe, RefusesNoiseThatIsNotPositive) {
  const MadeRun run = make_run({});
  EXPECT_EQ(observe(run.samples, run.machine, run.path, {0.0, 3e-6}, run.options).error().code,
            ErrorCode::BadInput);
}

TEST(Observe, CoversTheVolumeOfThePath) {
  const MadeRun run = make_run({});
  const auto o = observe(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(o);
  EXPECT_THAT(o->covered_m, testing::Contains(run.path.vertices_m.front()));
  for (const Vector3& p : o->covered_m) {
    EXPECT_LE(p.x(), 0.3 + 1e-12);
  }
}

}  // namespace

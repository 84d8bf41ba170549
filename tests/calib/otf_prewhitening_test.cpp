#include "abbe/calib/internal/otf/solve/prewhitening.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "abbe/calib/internal/otf/observe/row_residuals.hpp"
#include "abbe/calib/model/model_datum.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "otf_run.hpp"
#include "repetitions.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;

/// Noise of the tracker's readings beside the white noise of the run.
struct SlowReadings {
  double range_m = 2e-6, angle_rad = 3e-6, correlation_s = 0.5;
};

void add_noise(MadeRun& run, const SlowReadings& slow, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Vector3 x = Vector3::Zero();
  double before_s = -1e3;
  for (TrackerObservation& sample : run.samples) {
    const double keep = std::exp((before_s - sample.time_s) / slow.correlation_s);
    before_s = sample.time_s;
    for (Eigen::Index k = 0; k < 3; ++k) {
      x(k) = keep * x(k) + std::sqrt(1.0 - keep * keep) * normal(random);
    }
    const Vector3 beam = sample.p_tracker_m.normalized();
    const Vector3 azimuth = Vector3::UnitZ().cross(beam).normalized();
    sample.p_tracker_m +=
        slow.range_m * x(0) * beam +
        slow.angle_rad * sample.p_tracker_m.norm() * (x(1) * azimuth + x(2) * beam.cross(azimuth));
  }
}

/// White noise of 2 um and 3 urad, and slow noise.
MadeRun run_with_slow_noise(const SlowReadings& slow, unsigned seed = 7) {
  MadeRun run = make_run({.noise_seed = seed});
  add_noise(run, slow, 1000 + seed);
  run.options.estimator = Estimator::Simultaneous;
  return run;
}

Identification identification_with(const MadeRun& run) {
  return *identify(run.samples, run.machine, run.path, run.noise, run.options);
}

TEST(IsCorrelated, NotWhiteNoise) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    MadeRun run = make_run({.seed = seed, .noise_seed = seed});
    run.options.estimator = Estimator::Simultaneous;
    const Identification id = identification_with(run);
    EXPECT_FALSE(is_correlated(id.observations, id.solution.residuals.after_m)) << seed;
    EXPECT_EQ(id.solution.statistics.noise_correlation, (std::array{0.0, 0.0}));
  }
}

/// The residuals are smaller and less correlated than the noise, because the unknowns follow it.
TEST(EstimateNoise, FindsTheNoiseThatTheUnknownsFollow) {
  constexpr int kRuns = 4;
  TrackerNoise mean{.white_factor = 0.0};
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    const Identification id = identification_with(run_with_slow_noise({}, seed));
    const TrackerNoise found =
        *estimate_noise(id.observations, residuals_m(id.observations, id.solution.adjustment.U));
    mean.white_factor += found.white_factor / kRuns;
    mean.slow_range_m += found.slow_range_m / kRuns;
    mean.slow_angle_rad += found.slow_angle_rad / kRuns;
    mean.correlation_time += found.correlation_time / kRuns;
  }
  EXPECT_NEAR(mean.white_factor, 1.0, 0.06);
  EXPECT_NEAR(mean.slow_range_m, 2e-6, 0.2e-6);
  EXPECT_NEAR(mean.slow_angle_rad, 3e-6, 0.15e-6);
  EXPECT_NEAR(mean.correlation_time, 0.5, 0.05);
}

/// Only angles are disturbed by turbulence, ranges are white.
TEST(EstimateNoise, SeparatesRangesFromAngles) {
  const Identification id =
      identification_with(run_with_slow_noise({.range_m = 0.0, .angle_rad = 6e-6}));
  const TrackerNoise found =
      *estimate_noise(id.observations, residuals_m(id.observations, id.solution.adjustment.U));
  EXPECT_LT(found.slow_range_m, 0.5e-6);
  EXPECT_NEAR(found.slow_angle_rad, 6e-6, 0.6e-6);
}

/// Any solution of the unknowns gives the same noise.
TEST(EstimateNoise, DoesNotDependOnU) {
  const Identification id = identification_with(run_with_slow_noise({}));
  const Observations& o = id.observations;
  Eigen::VectorXd U = id.solution.adjustment.U;
  const TrackerNoise found = *estimate_noise(o, residuals_m(o, U));
  U.array() += 1e-6;
  const TrackerNoise other = *estimate_noise(o, residuals_m(o, U));
  EXPECT_NEAR(other.correlation_time, found.correlation_time, 0.01 * found.correlation_time);
  EXPECT_NEAR(other.slow_angle_rad, found.slow_angle_rad, 0.01 * found.slow_angle_rad);
}

/// A third of the machine and of the path, so that the full covariance can be inverted.
MadeRun small_run() {
  MadeRun run = make_run({.noise_factor = 0.0});
  constexpr double kSize = 0.34;
  for (AxisNodes& axis : run.machine.nodes) {
    for (double& node_m : axis.nodes_m) {
      node_m *= kSize;
    }
    axis.reference_m *= kSize;
  }
  for (Vector3& q : run.path.vertices_m) {
    q *= kSize;
  }
  const MadeRunOptions wanted{.noise_seed = 3};
  measure_run(run, wanted);
  add_noise(run, {}, 3);
  run.options.estimator = Estimator::Simultaneous;
  return run;
}

/// Covariance of the mean of unit slow noise over two segments whose middles are `apart` from each
/// other: the integral of exp(-|t - t'| / tau) over both, divided by the square of the duration.
double covariance_of_means(double apart_s, double duration_s, double tau_s) {
  const double x = duration_s / tau_s;
  if (apart_s < 0.5 * duration_s) {
    return 2.0 * (x - 1.0 + std::exp(-x)) / (x * x);
  }
  const double root = 2.0 * std::sinh(0.5 * x) / x;
  return root * root * std::exp(-apart_s / tau_s);
}

/// Covariance of all rows, by the definition in prewhitening.hpp.
Eigen::MatrixXd covariance_of(const Observations& o, const TrackerNoise& noise) {
  const auto m = static_cast<Eigen::Index>(o.rows.size());
  const double duration_s = o.segment_s[1] - o.segment_s[0];
  Eigen::MatrixXd range(m, 1), azimuth(m, 1), elevation(m, 1);
  for (Eigen::Index i = 0; i < m; ++i) {
    const Observation& row = o.rows[static_cast<std::size_t>(i)];
    const RigidTransform& T = o.alignment.T_machine_tracker;
    const Vector3 beam_m = row.axis_position_m + o.target_offset_m - T.t_m;
    const Vector3 across = (T.R * Vector3::UnitZ()).cross(beam_m.normalized()).normalized();
    range(i) = noise.slow_range_m * row.direction.dot(beam_m.normalized());
    azimuth(i) = noise.slow_angle_rad * beam_m.norm() * row.direction.dot(across);
    elevation(i) = noise.slow_angle_rad * row.direction.dot(beam_m.cross(across));
  }
  Eigen::MatrixXd C(m, m);
  for (Eigen::Index i = 0; i < m; ++i) {
    for (Eigen::Index j = 0; j < m; ++j) {
      const Observation &a = o.rows[static_cast<std::size_t>(i)],
                        &b = o.rows[static_cast<std::size_t>(j)];
      C(i, j) = (range(i) * range(j) + azimuth(i) * azimuth(j) + elevation(i) * elevation(j)) *
                covariance_of_means(std::abs(o.segment_s[a.segment] - o.segment_s[b.segment]),
                                    duration_s, noise.correlation_time);
    }
    const double sigma_m = o.rows[static_cast<std::size_t>(i)].sigma_m;
    C(i, i) += noise.white_factor * sigma_m * sigma_m;
  }
  return C;
}

/// Generalised least squares by its definition.
struct Generalised {
  Eigen::VectorXd U;
  Eigen::MatrixXd cofactor;
};
Generalised generalised_least_squares(const Observations& o, const Eigen::MatrixXd& C) {
  const auto n = static_cast<Eigen::Index>(o.unknowns());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(C.rows(), n);
  Eigen::VectorXd y(C.rows());
  for (Eigen::Index i = 0; i < C.rows(); ++i) {
    y(i) = o.rows[static_cast<std::size_t>(i)].y_m;
    for (const SparseRows::Entry& e : o.A.row(static_cast<std::size_t>(i))) {
      A(i, static_cast<Eigen::Index>(e.column)) = e.value;
    }
  }
  const Eigen::LLT<Eigen::MatrixXd> llt(C);
  const Eigen::MatrixXd CA = llt.solve(A);
  const Eigen::MatrixXd H = A.transpose() * CA;
  const Eigen::VectorXd scale = H.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd K =
      (datum_conditions(ModelDatum::G1, o.basis, o.unknowns()) * scale.asDiagonal())
          .rowwise()
          .normalized();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * H * scale.asDiagonal() + K.transpose() * K;
  const Eigen::MatrixXd Q =
      scale.asDiagonal() * scaled.llt().solve(Eigen::MatrixXd::Identity(n, n)) * scale.asDiagonal();
  return {Q * (CA.transpose() * y), Q * H * Q};
}

TEST(Prewhitening, IsGeneralisedLeastSquaresWithTheCovarianceOfAllRows) {
  MadeRun run = small_run();
  for (std::size_t i = 2000; i < 2150; ++i) {
    run.samples[i].valid = false;  // within a leg
  }
  const Identification id = identification_with(run);
  const Observations& o = id.observations;
  const TrackerNoise noise = *estimate_noise(o, id.solution.residuals.after_m);
  const Generalised expected = generalised_least_squares(o, covariance_of(o, noise));

  const auto n = static_cast<Eigen::Index>(o.basis.size());
  const VolumetricModel& model = id.solution.model;
  EXPECT_LT((model.U() - expected.U.head(n)).cwiseAbs().maxCoeff(), 1e-11);  // of 1e-4
  EXPECT_GT((id.solution.adjustment.U - expected.U).cwiseAbs().maxCoeff(), 1e-8);
  // The factor of the covariance is estimated again, from the prewhitened residuals.
  const Eigen::ArrayXd stated = model.covariance().diagonal().array(),
                       asked = expected.cofactor.diagonal().head(stated.size()).array();
  constexpr double kFixed = 1e-20;  // by the datum: rounding
  EXPECT_TRUE(((stated - asked).abs() <= 0.02 * asked.abs() + kFixed).all());
}

TEST(Prewhitening, LeavesNoCorrelationToWiden) {
  const Identification id = identification_with(run_with_slow_noise({}));
  const Statistics& s = id.solution.statistics;
  EXPECT_NEAR(s.noise_correlation[0], 0.85, 0.05);  // slow 1, white 0.1, exp(-0.04 / 0.5)
  EXPECT_NEAR(s.noise_correlation[1], 0.85, 0.05);
  EXPECT_GT(s.correlation, 5.0);  // of the rows themselves
  EXPECT_LT(s.variance_factor, 1.3 * s.chi2_per_dof);
}

/// e^T C^-1 e / n of the errors e of the parameters in the n coordinates that the datum leaves
/// free.
double normalised_squared_error(const MadeRun& run, const Identification& id) {
  Eigen::VectorXd truth =
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(id.observations.unknowns()));
  truth.head(run.truth.size()) = run.truth;
  truth = *to_datum(ModelDatum::G1, id.observations.layout(),
                    std::array{run.machine.target_offset_m}, truth);
  const Eigen::MatrixXd N = datum_coordinates(id.observations.basis).N;
  const VolumetricModel& model = id.solution.model;
  const Eigen::VectorXd e = N.transpose() * (model.U() - truth.head(model.U().size()));
  const Eigen::MatrixXd C = N.transpose() * model.covariance() * N;
  const Eigen::VectorXd scale = C.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * C * scale.asDiagonal();
  const Eigen::VectorXd w = scaled.llt().matrixL().solve(scale.asDiagonal() * e);
  return w.squaredNorm() / static_cast<double>(w.size());
}

/// 1 with a standard deviation of 0.07 from the noise of the runs. Autoregression coefficients from
/// the residuals, along each leg, gave 1.35 (0.5 s) and 0.61 (10 s).
class UOfCorrelatedNoise : public ::testing::TestWithParam<double> {};

TEST_P(UOfCorrelatedNoise, IsThatOfTheErrors) {
  constexpr unsigned kRuns = abbe::tests::repetitions(16u);
  double mean = 0.0;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    const MadeRun run = run_with_slow_noise({.correlation_s = GetParam()}, seed);
    const double of_run = normalised_squared_error(run, identification_with(run));
    EXPECT_GT(of_run, 0.0);
    EXPECT_LT(of_run, 10.0);
    mean += of_run / kRuns;
  }
  if (abbe::tests::kAllRepetitions) {
    EXPECT_GT(mean, 0.85);
    EXPECT_LT(mean, 1.15);
  }
}

INSTANTIATE_TEST_SUITE_P(Seconds, UOfCorrelatedNoise, ::testing::Values(0.5, 10.0));

}  // namespace

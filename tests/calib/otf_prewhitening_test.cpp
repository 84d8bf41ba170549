#include "abbe/calib/otf/prewhitening.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "abbe/calib/gauge.hpp"
#include "abbe/calib/otf/identify.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;

/// Noise of the tracker with standard deviation 3 um per component and an autocorrelation of `rho`
/// from block to block.
MadeRun run_with_slow_noise(double rho, unsigned seed = 7) {
  MadeRun run = make_run({.noise_factor = 0.0});
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const double keep = std::pow(rho, 1.0 / static_cast<double>(run.options.block_samples));
  Vector3 noise_m = Vector3::Zero();
  for (TrackerObservation& sample : run.samples) {
    const double x = normal(random), y = normal(random), z = normal(random);
    noise_m = keep * noise_m + 3e-6 * std::sqrt(1.0 - keep * keep) * Vector3(x, y, z);
    sample.p_tracker_m += noise_m;
  }
  run.options.estimator = Estimator::Joint;
  return run;
}

Identification identification_with(const MadeRun& run) {
  return *identify(run.samples, run.machine, run.path, run.noise, run.options);
}

TEST(NoiseFilter, OfWhiteNoiseIsWhite) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    MadeRun run = make_run({.seed = seed, .noise_seed = seed});
    run.options.estimator = Estimator::Joint;
    const Identification id = identification_with(run);
    EXPECT_TRUE(noise_filter(id.observations, id.solution.residuals.after_m).is_white()) << seed;
    EXPECT_EQ(id.solution.statistics.noise_correlation, (std::array{0.0, 0.0}));
  }
}

/// Residuals of an autoregressive process: the filter finds its coefficients.
TEST(NoiseFilter, FindsTheCoefficientsOfAnAutoregression) {
  const MadeRun run = make_run({});
  const Observations o = *observe(run.samples, run.machine, run.path, run.noise, run.options);
  constexpr double kFirst = 1.1, kSecond = -0.3;
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  std::vector<double> w(o.rows.size(), 0.0);
  for (std::size_t i = 4; i < w.size(); ++i) {
    w[i] = kFirst * w[i - 2] + kSecond * w[i - 4] + normal(random);
  }

  std::vector<double> residual_m = w;
  for (std::size_t i = 0; i < w.size(); ++i) {
    residual_m[i] *= o.rows[i].sigma_m;
  }

  const NoiseFilter filter = noise_filter(o, residual_m);
  for (const Autoregression& found : std::span(filter.of_direction).first(2)) {
    ASSERT_EQ(found.order, 2u);
    EXPECT_NEAR(found.coefficient[2][0], kFirst, 0.07);  // 3 / sqrt(2500 blocks)
    EXPECT_NEAR(found.coefficient[2][1], kSecond, 0.07);
  }
}

/// Covariance of the rows of one direction between blocks `first` and `last` of a leg, whose noise
/// has the autocorrelations of `noise`.
Eigen::MatrixXd covariance_of(const Autoregression& noise, const Eigen::VectorXd& sigma_m) {
  const Eigen::Index n = sigma_m.size();
  Eigen::VectorXd r(n);
  r(0) = 1.0;
  for (Eigen::Index lag = 1; lag < n; ++lag) {
    const auto order = std::min<Eigen::Index>(lag, static_cast<Eigen::Index>(noise.order));
    r(lag) = 0.0;
    for (Eigen::Index k = 1; k <= order; ++k) {
      r(lag) +=
          noise.coefficient[static_cast<std::size_t>(order)][static_cast<std::size_t>(k - 1)] *
          r(lag - k);
    }
  }

  Eigen::MatrixXd C(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      C(i, j) = sigma_m(i) * sigma_m(j) * r(std::abs(i - j));
    }
  }
  return C;
}

/// Generalised least squares with the full covariance of every leg, by its definition.
Eigen::VectorXd generalised_least_squares(const Observations& o, const NoiseFilter& filter) {
  const auto n = static_cast<Eigen::Index>(o.unknowns());
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(n);
  for (std::size_t begin = 0; begin < o.rows.size();) {
    std::size_t end = begin + 2;
    while (end < o.rows.size() && o.rows[end].leg == o.rows[begin].leg &&
           o.rows[end].block == o.rows[end - 2].block + 1) {
      end += 2;
    }

    for (const std::size_t direction : {0U, 1U}) {
      const auto rows = static_cast<Eigen::Index>((end - begin) / 2);
      Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows, n);
      Eigen::VectorXd y(rows), sigma_m(rows);
      for (Eigen::Index k = 0; k < rows; ++k) {
        const std::size_t i = begin + direction + 2 * static_cast<std::size_t>(k);
        for (const SparseRows::Entry& e : o.A.row(i)) {
          A(k, static_cast<Eigen::Index>(e.column)) = e.value;
        }
        y(k) = o.rows[i].y_m;
        sigma_m(k) = o.rows[i].sigma_m;
      }
      const Eigen::LLT<Eigen::MatrixXd> C(covariance_of(filter.of_direction[direction], sigma_m));
      const Eigen::MatrixXd CA = C.solve(A);
      H += A.transpose() * CA;
      g += CA.transpose() * y;
    }
    begin = end;
  }

  const Eigen::MatrixXd K = gauge_conditions(Gauge::G1, o.basis, o.unknowns());
  const Eigen::VectorXd scale = H.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled_K = (K * scale.asDiagonal()).rowwise().normalized();
  const Eigen::MatrixXd scaled =
      scale.asDiagonal() * H * scale.asDiagonal() + scaled_K.transpose() * scaled_K;
  return scale.asDiagonal() * Eigen::VectorXd(scaled.llt().solve(scale.asDiagonal() * g));
}

TEST(Prewhitening, IsGeneralisedLeastSquaresWithTheCovarianceOfEveryLeg) {
  MadeRun run = run_with_slow_noise(0.8);
  for (std::size_t i = 10000; i < 10200; ++i) {
    run.samples[i].valid = false;  // within a leg
  }
  const Identification id = identification_with(run);
  const Observations& o = id.observations;
  // The coefficients that the second repeat estimates, from the residuals of the first.
  const NoiseFilter first = noise_filter(o, solve(o, run.options)->residuals.after_m);
  std::vector<double> residual_m(o.rows.size());
  const Eigen::VectorXd U_first = generalised_least_squares(o, first);
  for (std::size_t i = 0; i < residual_m.size(); ++i) {
    residual_m[i] = o.rows[i].y_m;
    for (const SparseRows::Entry& e : o.A.row(i)) {
      residual_m[i] -= e.value * U_first(static_cast<Eigen::Index>(e.column));
    }
  }

  const Eigen::VectorXd U = generalised_least_squares(o, noise_filter(o, residual_m));
  const auto n = static_cast<Eigen::Index>(o.basis.size());
  EXPECT_LT((id.solution.model.U() - U.head(n)).cwiseAbs().maxCoeff(), 1e-11);  // of 1e-4
  EXPECT_GT((id.solution.adjustment.U - U).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(Prewhitening, LeavesNoCorrelationToWiden) {
  const Identification id = identification_with(run_with_slow_noise(0.8));
  const Statistics& s = id.solution.statistics;
  EXPECT_NEAR(s.noise_correlation[0], 0.8, 0.1);
  EXPECT_NEAR(s.noise_correlation[1], 0.8, 0.1);
  EXPECT_GT(s.correlation, 5.0);  // of the rows themselves: 9
  EXPECT_LT(s.variance_factor, 1.3 * s.chi2_per_dof);
}

/// Errors of V in units of the stated uncertainty, over runs with other noise.
TEST(Prewhitening, StatesTheUncertaintyOfCorrelatedNoise) {
  double squares = 0.0, squares_white = 0.0, normalised = 0.0;
  std::size_t count = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const MadeRun run = run_with_slow_noise(0.9, seed);
    const Identification id = identification_with(run);
    const Eigen::VectorXd truth = [&] {
      Eigen::VectorXd with_rigid =
          Eigen::VectorXd::Zero(static_cast<Eigen::Index>(id.observations.unknowns()));
      with_rigid.head(run.truth.size()) = run.truth;
      return Eigen::VectorXd(*to_gauge(Gauge::G1, id.observations.layout(),
                                       std::array{run.machine.target_offset_m}, with_rigid));
    }();
    const Eigen::MatrixXd& covariance = id.solution.model.covariance();
    for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
      if (covariance(i, i) > 0.0) {
        const double error = id.solution.model.U()(i) - truth(i);
        const double white = id.solution.adjustment.U(i) - truth(i);
        normalised += error * error / covariance(i, i);
        squares += error * error;
        squares_white += white * white;
        ++count;
      }
    }
  }

  EXPECT_NEAR(normalised / static_cast<double>(count), 1.1, 0.4);
  EXPECT_LT(squares, squares_white);
}

}  // namespace

/// The offset common to all ranges, estimated with its prior together with the errors of the
/// machine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "abbe/calib/otf/identify/identify.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using abbe::tests::otf::MadeRun;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr double kPrior_m = 6e-6;

/// Small errors: the alignment absorbs the offset in part, and its path stays what it is.
MadeRun run_with_offset(double offset_m, double u_m) {
  MadeRun run = abbe::tests::otf::make_run({});
  for (TrackerObservation& sample : run.samples)
    sample.p_tracker_m += offset_m * sample.p_tracker_m.normalized();
  run.noise.u_range_offset_m = u_m;
  return run;
}

Identification identification(const MadeRun& run) {
  return *identify(run.samples, run.machine, run.path, run.noise, run.options);
}

/// An offset within its prior, identified once.
const Identification& within_prior() {
  static const Identification found = identification(run_with_offset(8e-6, kPrior_m));
  return found;
}

struct Dense {
  double offset_m = 0.0, u_m = 0.0;
  Eigen::VectorXd fitted;  ///< of every row, divided by its standard uncertainty
};

/// Rows and prior in one dense least-squares problem; the shortest solution determines the rigid
/// motion and the datum.
Dense dense_solution(const Observations& o) {
  const auto rows = static_cast<Eigen::Index>(o.rows.size()),
             n = static_cast<Eigen::Index>(o.unknowns());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows + 1, n + 1);
  Eigen::VectorXd y = Eigen::VectorXd::Zero(rows + 1);
  constexpr double kUnit_m = 1e-6;  // of the offset

  for (Eigen::Index i = 0; i < rows; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double sigma_m = o.rows[k].sigma_m;
    for (const SparseRows::Entry& e : o.A.row(k))
      A(i, static_cast<Eigen::Index>(e.column)) += e.value / sigma_m;
    const Vector3 beam =
        o.rows[k].axis_position_m + o.target_offset_m - o.alignment.T_machine_tracker.t_m;
    A(i, n) = o.rows[k].direction.dot(beam) / beam.norm() * kUnit_m / sigma_m;
    y(i) = o.rows[k].y_m / sigma_m;
  }

  A(rows, n) = kUnit_m / o.u_range_offset_m;
  const Eigen::VectorXd length = A.colwise().norm();
  const Eigen::MatrixXd scaled = A * length.cwiseInverse().asDiagonal();
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> qr(scaled);
  const Eigen::VectorXd x = length.cwiseInverse().asDiagonal() * qr.solve(y);
  const Eigen::MatrixXd pseudo = qr.pseudoInverse();

  return {kUnit_m * x(n), kUnit_m * pseudo.row(n).norm() / length(n), (A * x).head(rows)};
}

TEST(RangeOffset, EqualsADenseAdjustmentWithTheOffsetAsUnknown) {
  const Identification& id = within_prior();
  const Dense dense = dense_solution(id.observations);
  EXPECT_NEAR(id.solution.range_offset.value_m, dense.offset_m, 1e-9);
  EXPECT_NEAR(id.solution.range_offset.u_m, dense.u_m, 1e-9);
  for (std::size_t i = 0; i < id.observations.rows.size(); ++i) {
    const Observation& row = id.observations.rows[i];
    const double fitted = (row.y_m - id.solution.residuals.after_m[i]) / row.sigma_m;
    ASSERT_NEAR(fitted, dense.fitted(static_cast<Eigen::Index>(i)), 1e-4) << "row " << i;
  }
}

TEST(RangeOffset, WithoutAPriorThereIsNone) {
  const Identification id = identification(run_with_offset(8e-6, 0.0));
  EXPECT_EQ(id.solution.range_offset.value_m, 0.0);
  EXPECT_EQ(id.solution.range_offset.u_m, 0.0);
}

TEST(RangeOffset, ItsUncertaintyWidensTheModel) {
  const auto variance = [](double u_m) {
    return identification(run_with_offset(0.0, u_m)).solution.model.covariance().trace();
  };
  const double none = variance(0.0), small = variance(1e-6), large = variance(20e-6);
  EXPECT_LT(none, small);
  EXPECT_LT(small, large);
}

TEST(RangeOffset, TakesMostOfItsErrorOutOfTheModel) {
  const Identification sound = identification(run_with_offset(0.0, 0.0));
  const auto error_um = [&](double u_m) {
    const Identification id = identification(run_with_offset(100e-6, u_m));
    return 1e6 * (id.solution.model.U() - sound.solution.model.U()).norm();
  };
  EXPECT_LT(error_um(200e-6), 0.3 * error_um(0.0));
}

TEST(RangeOffset, BeyondItsStatedUncertaintyItIsNamed) {
  const MadeRun run = run_with_offset(300e-6, kPrior_m);
  const Identification id = identification(run);
  const auto verdict = judge(id.observations, id.solution, nullptr, {}, run.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_THAT(verdict->reasons,
              Contains(AllOf(HasSubstr("offset of"), HasSubstr("stated uncertainty is 6 um"))));
}

TEST(RangeOffset, WithinItsStatedUncertaintyNothingIsSaid) {
  const MadeRun run = run_with_offset(8e-6, kPrior_m);
  const Identification& id = within_prior();
  const auto verdict = judge(id.observations, id.solution, nullptr, {}, run.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_THAT(verdict->reasons, Not(Contains(HasSubstr("offset of"))));
  EXPECT_THAT(verdict->notes, Not(Contains(HasSubstr("offset of"))));
}

/// The limit in the verdict's note, um; nullopt: no such note.
std::optional<double> noted_limit_um(double u_m) {
  const MadeRun run = run_with_offset(0.0, u_m);
  const Identification id = identification(run);
  const auto verdict = judge(id.observations, id.solution, nullptr, {}, run.options);
  for (const std::string& note : verdict->notes) {
    const std::string before = "an offset below ";
    if (const auto at = note.find(before); at != std::string::npos)
      return std::stod(note.substr(at + before.size()));
  }
  return std::nullopt;
}

/// The uncertainty with a prior of 1 m: what the run alone determines of the offset.
TEST(RangeOffset, ALimitIsNotedWhereTheDataDetermineItLessThanThePrior) {
  const double u_m = identification(run_with_offset(0.0, 1.0)).solution.range_offset.u_m;
  const auto limit_um = noted_limit_um(0.5 * u_m);
  ASSERT_TRUE(limit_um);
  EXPECT_NEAR(*limit_um, 2.576 * std::sqrt(1.25) * 1e6 * u_m, 1e-3 * 1e6 * u_m);
  EXPECT_FALSE(noted_limit_um(2.0 * u_m));
}

TEST(RangeOffset, ANegativeUncertaintyIsRefused) {
  for (const double bad : {-1e-6, std::numeric_limits<double>::quiet_NaN()}) {
    MadeRun run = run_with_offset(0.0, bad);
    const auto id = identify(run.samples, run.machine, run.path, run.noise, run.options);
    ASSERT_FALSE(id);
    EXPECT_THAT(id.error().text, HasSubstr("u_range_offset"));
  }
}

}  // namespace

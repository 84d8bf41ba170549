#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <numeric>

#include "abbe/calib/internal/otf/identify/observe_run.hpp"
#include "abbe/calib/model/model_update.hpp"
#include "drift_models.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::HasSubstr;

/// Largest eigenvalue of A - B relative to B, both scaled to the variances of B: not above 0 if A
/// is nowhere larger.
double largest_excess(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  const Eigen::VectorXd scale = B.diagonal().unaryExpr(
      [](double variance) { return variance > 0.0 ? 1.0 / std::sqrt(variance) : 0.0; });
  const Eigen::MatrixXd D = scale.asDiagonal() * (A - B) * scale.asDiagonal();
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(D).eigenvalues().maxCoeff();
}

/// Rows of a run and the model of these rows alone.
struct RunOfRows {
  Observations observations;
  RowInformation rows;
  VolumetricModel model;
};

RunOfRows run_of_rows(const MadeRun& run) {
  Observations o = *observe(run.samples, run.machine, run.path, run.noise, run.options);
  RowInformation rows = information_of(o);
  const Adjustment a = *adjust(rows, o);
  const auto n = static_cast<Eigen::Index>(o.basis.size());
  VolumetricModel model = *VolumetricModel::from_vector(
      o.layout(), ModelDatum::G1, std::array{o.target_offset_m}, a.U.head(n),
      a.covariance.topLeftCorner(n, n), *ValidityVolume::hull_of(o.covered_m));
  return {std::move(o), std::move(rows), std::move(model)};
}

/// Both runs in one adjustment, each with rigid unknowns of its own.
estimation::DatumSolution adjustment_of_both(const RunOfRows& a, const RunOfRows& b) {
  const std::size_t model = a.observations.basis.size(), one = a.observations.unknowns();
  const std::size_t both = one + kRigidUnknowns;
  std::vector<std::size_t> at_a(one), at_b(one);
  std::iota(at_a.begin(), at_a.end(), std::size_t{0});
  std::iota(at_b.begin(), at_b.end(), std::size_t{0});
  std::iota(at_b.begin() + static_cast<std::ptrdiff_t>(model), at_b.end(), one);

  estimation::Information sum(both);
  sum.add(a.rows.data, at_a);
  sum.add(b.rows.data, at_b);
  const estimation::Datum datum(datum_conditions(ModelDatum::G1, a.observations.basis, both));
  return *datum.solve(sum);
}

TEST(ModelUpdate, WithoutProcessNoiseIsTheAdjustmentOfBothRuns) {
  MadeRun second = make_run({.noise_seed = 2, .rate_hz = 500.0});
  const RunOfRows a = run_of_rows(make_run({.noise_seed = 1})), b = run_of_rows(second);
  const estimation::DatumSolution both = adjustment_of_both(a, b);
  const VolumetricModel updated = *update_model(a.model, b.model);
  const Eigen::Index n = updated.U().size();
  const Eigen::VectorXd u = updated.covariance().diagonal().cwiseSqrt();

  EXPECT_LT((updated.U() - both.U.head(n)).cwiseAbs().maxCoeff(), 1e-6 * u.maxCoeff());
  EXPECT_LT((updated.covariance() - both.covariance.topLeftCorner(n, n)).cwiseAbs().maxCoeff(),
            1e-9 * u.maxCoeff() * u.maxCoeff());
}

TEST(ModelUpdate, IsNeverLessCertainThanTheRunAlone) {
  RepeatedRuns runs(1);
  const VolumetricModel run = runs.run();
  for (const double days : {0.0, 1.0, 1000.0}) {
    const UpdateOptions options{.forgetting = 0.8,
                                .days = days,
                                .length_m_per_root_day = 1e-6,
                                .angle_rad_per_root_day = 1e-6,
                                .u_scale = 0.2e-6,
                                .u_axis_scale = {1e-6, 1e-6, 1e-6}};
    const VolumetricModel updated = *update_model(runs.run(), run, options);
    EXPECT_LT(largest_excess(updated.covariance(), run.covariance()), 1e-9) << days;
  }
}

TEST(ModelUpdate, MeetsTheDatumExactly) {
  RepeatedRuns runs(2);
  const VolumetricModel updated = *update_model(runs.run(), runs.run());
  for (const Parameter& p : updated.parameters()) {
    const bool fixed = p.name == "EYX" && p.position_m == runs.layout().nodes()[0].nodes_m.front();
    EXPECT_TRUE(!fixed || (p.value == 0.0 && p.u == 0.0));
  }
  EXPECT_TRUE(VolumetricModel::from_description(updated.description()));
}

TEST(ModelUpdate, OldInformationFadesWithProcessNoise) {
  RepeatedRuns runs(3);
  const VolumetricModel previous = runs.run(), run = runs.run();
  const UpdateOptions long_ago{
      .days = 1e12, .length_m_per_root_day = 1e-6, .angle_rad_per_root_day = 1e-6};
  const VolumetricModel updated = *update_model(previous, run, long_ago);
  EXPECT_LT((updated.U() - run.U()).cwiseAbs().maxCoeff(), 1e-12);
}

/// Many runs: the part that all runs have in common does not average out.
TEST(ModelUpdate, KeepsTheUncertaintyCommonToAllRuns) {
  RepeatedRuns runs(4);
  const UpdateOptions common{.u_scale = 0.5e-6, .u_axis_scale = {2e-6, 2e-6, 2e-6}};
  VolumetricModel model = runs.run();
  for (int i = 0; i < 50; ++i) {
    model = *update_model(model, runs.run(), common);
  }
  const double half_m = runs.layout().nodes()[0].nodes_m.back();
  const double u_m = model.parameters()[runs.layout().node_count(Axis::X) - 1].u;
  EXPECT_GE(u_m, std::hypot(0.5e-6, 2e-6) * half_m);
}

TEST(ModelUpdate, ARenewedTableComesFromTheRunAlone) {
  RepeatedRuns runs(5);
  const VolumetricModel run = runs.run();
  const UpdateOptions renewed{.renewed = {"EXX"}};
  const VolumetricModel previous = runs.run();
  const VolumetricModel moved =
      runs.with(previous.U() + runs.change("EXX", 50.0), previous.covariance());
  const VolumetricModel a = *update_model(previous, run, renewed);
  const VolumetricModel b = *update_model(moved, run, renewed);
  EXPECT_LT((a.U() - b.U()).cwiseAbs().maxCoeff(), 1e-15);
}

TEST(ModelUpdate, ProcessNoiseOfOneTableWeakensThatTable) {
  RepeatedRuns runs(6);
  const VolumetricModel previous = runs.run(), run = runs.run();
  const VolumetricModel all = *update_model(previous, run, {.days = 1.0});
  const VolumetricModel one =
      *update_model(previous, run, {.days = 1.0, .of_tables = {{"EXX", 100e-6}}});
  const auto u = [](const VolumetricModel& m, std::size_t i) { return m.parameters()[i].u; };
  EXPECT_GT(u(one, 0), 1.2 * u(all, 0));
  const std::size_t squareness = runs.layout().squareness_offset();
  EXPECT_NEAR(u(one, squareness), u(all, squareness), 0.2 * u(all, squareness));
}

TEST(ModelUpdate, RefusesOptionsOutOfRange) {
  RepeatedRuns runs(7);
  const VolumetricModel m = runs.run();
  for (const UpdateOptions& wrong :
       {UpdateOptions{.forgetting = 0.0}, UpdateOptions{.forgetting = 1.1},
        UpdateOptions{.days = -1.0}, UpdateOptions{.days = std::nan("")},
        UpdateOptions{.renewed = {"EXQ"}}, UpdateOptions{.of_tables = {{"EXQ", 1e-6}}}}) {
    EXPECT_EQ(update_model(m, m, wrong).error().code, ErrorCode::BadInput);
  }
}

TEST(ModelUpdate, RefusesACommonPartLargerThanTheUncertainty) {
  RepeatedRuns runs(8);
  const auto updated = update_model(runs.run(), runs.run(), {.u_scale = 1e-3});
  ASSERT_FALSE(updated);
  EXPECT_THAT(updated.error().text, HasSubstr("common to all runs"));
}

}  // namespace

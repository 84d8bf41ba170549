#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "abbe/calib/model/gate.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/model/model_drift.hpp"
#include "abbe/calib/model/model_update.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::tests::otf;
using testing::HasSubstr;

const Vector3 kCubicTool(0.02, -0.015, -0.12);

Vector3 vector_from(const std::vector<double>& v, std::size_t from) {
  return {v.at(from), v.at(from + 1), v.at(from + 2)};
}

VolumetricModel table_model(const ParameterLayout& layout, const Eigen::VectorXd& U,
                            const Eigen::MatrixXd& covariance, Interpolation interpolation) {
  return *VolumetricModel::from_vector(
      layout, ModelDatum::G1, std::array{kCubicTool}, U, covariance,
      *ValidityVolume::hull_of(tensor_grid(layout.nodes())), interpolation);
}

Eigen::MatrixXd random_covariance(const ParameterLayout& layout, double u_m, unsigned seed) {
  std::mt19937_64 random(seed);
  const auto n = static_cast<Eigen::Index>(layout.model_size());
  Eigen::MatrixXd root(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    root.col(i) = random_tables(layout, u_m, random);
  }
  return root * root.transpose();
}

VolumetricModel random_cubic(unsigned seed = 7) {
  const ParameterLayout layout = layout_of(coarse_machine("[w b Z X Y (C1) t]"));
  std::mt19937_64 random(seed);
  return table_model(layout, random_tables(layout, 1e-4, random),
                     random_covariance(layout, 1e-8, seed), Interpolation::NaturalCubic);
}

// The reference is printed with 13 significant digits of values of 1e-4 m.
TEST(CubicModel, GivesTheReferenceErrorsAt50Points) {
  const auto layout = layout_of(case_a_machine());
  const Eigen::VectorXd U = case_a_tables(TableColumn::Truth);
  const VolumetricModel model =
      table_model(layout, U, Eigen::MatrixXd::Identity(U.size(), U.size()) * 1e-12,
                  Interpolation::NaturalCubic);
  ASSERT_EQ(model.tool_offsets_m().front(), case_a_machine().target_offset_m);
  const auto rows = read_rows(small_file("caseA_V_cubic_at_points.csv"));
  ASSERT_EQ(rows.size(), 50u);
  for (const ReferenceRow& row : rows) {
    const Vector3 q = vector_from(row.values, 0), V = vector_from(row.values, 3);
    EXPECT_LT((model.V_at(q, kCubicTool) - V).norm(), 1e-12);
    EXPECT_LT((model.error_at(q, kCubicTool).V_m - V).norm(), 1e-12);
  }
}

TEST(CubicModel, PropagatesItsFullCovariance) {
  const VolumetricModel model = random_cubic();
  std::vector<Column> memory(model.tables()->most_columns());
  for (const Vector3& q :
       {Vector3(0.13, -0.11, -0.27), Vector3(-0.3, 0.25, 0.0), Vector3(0.31, 0.2, -0.2)}) {
    ModelColumns columns(memory);
    model.tables()->append_columns({.q_m = q, .tool_offset_m = kCubicTool}, columns);
    Eigen::MatrixXd MB = Eigen::MatrixXd::Zero(3, model.U().size());
    for (const Column& c : columns.span()) {
      MB.col(static_cast<Eigen::Index>(c.parameter)) += c.dV_dU;
    }
    const VolumetricError e = model.error_at(q, kCubicTool);
    EXPECT_LT((e.V_m - MB * model.U()).norm(), 1e-17);
    EXPECT_TRUE(e.cov_V_m2.isApprox(MB * model.covariance() * MB.transpose(), 1e-11));
  }
}

TEST(CubicModel, IsNotLinearBetweenItsNodes) {
  const VolumetricModel model = random_cubic();
  EXPECT_FALSE(model.linear_between_nodes());
  EXPECT_EQ(model.interpolation(), Interpolation::NaturalCubic);
  EXPECT_THAT(
      model.nodes()[1].nodes_m,
      testing::Pointwise(testing::DoubleNear(1e-15), std::vector{-0.25, -0.125, 0.0, 0.125, 0.25}));
  EXPECT_EQ(model.tables()->layout().nodes()[1].nodes_m.size(), 3u);
  EXPECT_EQ(model.parameters()[1].position_m, model.tables()->layout().nodes()[0].nodes_m[1]);
}

TEST(CubicModel, ComesBackFromItsDescriptionBitForBit) {
  const VolumetricModel model = random_cubic();
  const auto again = VolumetricModel::from_description(model.description());
  ASSERT_TRUE(again) << again.error().text;
  const Vector3 q(0.2, 0.1, -0.1);
  EXPECT_EQ(again->interpolation(), Interpolation::NaturalCubic);
  EXPECT_EQ(again->error_at(q, kCubicTool).V_m, model.error_at(q, kCubicTool).V_m);
  EXPECT_EQ(again->error_at(q, kCubicTool).cov_V_m2, model.error_at(q, kCubicTool).cov_V_m2);
}

TEST(CubicModel, KeepsNotAKnotEnds) {
  const VolumetricModel natural = random_cubic();
  ModelDescription d = natural.description();
  d.interpolation = Interpolation::NotAKnotCubic;
  const auto model = VolumetricModel::from_description(d);
  ASSERT_TRUE(model) << model.error().text;
  EXPECT_EQ(model->interpolation(), Interpolation::NotAKnotCubic);
  EXPECT_EQ(model->description().interpolation, Interpolation::NotAKnotCubic);

  const Vector3 between = natural.tables()->layout().nodes()[0].nodes_m.front() * Vector3::Ones() +
                          Vector3::Constant(0.01);
  const Vector3 V_m = model->error_at(between, kCubicTool).V_m;
  EXPECT_LT((V_m - model->V_at(between, kCubicTool)).norm(), 1e-15);
  EXPECT_GT((V_m - natural.V_at(between, kCubicTool)).norm(), 1e-9);
}

/// An error of one node between two zeros: a cubic is largest beside the nodes, and steepest at the
/// neighbour nodes, where linear tables have 1.0 and 1.5 of these.
TEST(CubicModel, IsCheckedByTheGateBetweenItsNodes) {
  const ParameterLayout layout = layout_of(coarse_machine("[w X' b Y Z t]"));
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.model_size()));
  U(1) = U(2) = 1e-4;  // EXX at -0.1 and +0.1 m
  const Eigen::MatrixXd C = Eigen::MatrixXd::Identity(U.size(), U.size()) * 1e-16;
  const HeldOutFigures figures{.no_compensation = 2.0, .candidate = 1.0, .observations = 1000};
  const auto linear =
      decide(table_model(layout, U, C, Interpolation::Linear), figures, {}, nullptr);
  const auto cubic =
      decide(table_model(layout, U, C, Interpolation::NaturalCubic), figures, {}, nullptr);
  // Without the mean, which is a rigid motion.
  EXPECT_DOUBLE_EQ(linear.max_error_m, 0.5e-4);
  // Natural cubic through 0, 1, 1, 0: U'' = -6/5 / h^2 at the inner nodes, so 1 + 3/20 between them
  // and a slope of 1.2 / h at the ends. The mean of 0, 0.575, 1, 1.15, 1, 0.575, 0 is removed.
  EXPECT_NEAR(cubic.max_error_m, 4.3e-4 / 7.0, 1e-15);
  EXPECT_NEAR(cubic.max_gradient, 1.2 * 1e-4 / 0.2, 1e-8);
}

TEST(CubicModel, IsNotComparedWithLinearTablesParameterByParameter) {
  const VolumetricModel cubic = random_cubic();
  ModelDescription d = cubic.description();
  d.interpolation = Interpolation::Linear;
  const auto same = check_same_parameters(cubic, *VolumetricModel::from_description(d));
  ASSERT_FALSE(same);
  EXPECT_THAT(same.error().text, HasSubstr("linear, those of the other cubic"));
  EXPECT_TRUE(check_same_parameters(cubic, cubic));
}

}  // namespace

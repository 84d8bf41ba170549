#include "abbe/calib/model/volumetric_model.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::tests::otf;

const Vector3 kTool(0.02, -0.015, -0.12);

struct Made {
  ParameterLayout layout;
  Eigen::VectorXd U;
  Eigen::MatrixXd covariance;
};

Made random_model(double scale_m, unsigned seed = 11) {
  const ParameterLayout layout = layout_of(coarse_machine("[w X' b Y Z t]"));
  std::mt19937_64 random(seed);
  const Eigen::VectorXd U = random_tables(layout, scale_m, random);
  Eigen::MatrixXd root(U.size(), U.size());
  for (Eigen::Index i = 0; i < U.size(); ++i) {
    root.col(i) = random_tables(layout, 1e-8, random);
  }
  return {layout, U, root * root.transpose()};
}

ValidityVolume whole_volume(const ParameterLayout& layout) {
  return *ValidityVolume::hull_of(tensor_grid(layout.nodes()));
}

VolumetricModel model_of(const Made& m) {
  return *VolumetricModel::from_vector(m.layout, ModelDatum::G1, std::array{kTool}, m.U,
                                       m.covariance, whole_volume(m.layout));
}

TEST(VolumetricModel, PropagatesItsFullCovariance) {
  const Made m = random_model(1e-4);
  const Vector3 q(0.13, -0.11, -0.27);
  const VolumetricError e = model_of(m).error_at(q, kTool);
  Eigen::MatrixXd MB = Eigen::MatrixXd::Zero(3, m.U.size());
  const DesignColumns columns = design_columns(m.layout, q, kTool);
  for (const Column& c : columns.span()) {
    MB.col(static_cast<Eigen::Index>(c.parameter)) += c.dV_dU;
  }
  EXPECT_LT((e.V_m - MB * m.U).norm(), 1e-18);
  EXPECT_TRUE(e.cov_V_m2.isApprox(MB * m.covariance * MB.transpose(), 1e-12));
  EXPECT_TRUE(e.inside);
}

TEST(VolumetricModel, SaysWhereItExtrapolates) {
  const VolumetricModel model = model_of(random_model(1e-4));
  EXPECT_FALSE(model.error_at({0.31, 0, 0}, kTool).inside);
  EXPECT_TRUE(model.error_at({0.31, 0, 0}, kTool).tool_ok);
}

TEST(VolumetricModel, OfOneToolGivesNoNumberForAnother) {
  const VolumetricModel model = model_of(random_model(1e-4));
  const VolumetricError other = model.error_at({0, 0, 0}, kTool + Vector3(0, 0, 0.6e-3));
  EXPECT_FALSE(other.tool_ok);
  EXPECT_TRUE(other.V_m.array().isNaN().all());
  EXPECT_TRUE(model.error_at({0, 0, 0}, kTool + Vector3(0, 0, 0.4e-3)).tool_ok);
}

TEST(VolumetricModel, Of18TablesHoldsForAnyTool) {
  const otf::Machine machine = coarse_machine("[w X' b Y Z t]");
  const ParameterLayout layout = *ParameterLayout::all_tables(machine.chain, machine.nodes);
  std::mt19937_64 random(2);
  const Eigen::VectorXd U = random_tables(layout, 1e-4, random);
  const std::vector<Vector3> tools{{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}};
  const auto model = VolumetricModel::from_vector(layout, ModelDatum::G1, tools, U,
                                                  Eigen::MatrixXd::Identity(U.size(), U.size()),
                                                  whole_volume(layout));

  ASSERT_TRUE(model) << model.error().text;
  const Vector3 q(0.1, 0.1, -0.1), t(0.3, 0.2, -0.5);
  EXPECT_LT(
      (model->V_at(q, t) - volumetric_error(layout, {U.data(), layout.model_size()}, q, t)).norm(),
      1e-18);
}

VolumetricModel of_18_tables(const std::vector<Vector3>& tools) {
  const otf::Machine machine = coarse_machine("[w X' b Y Z t]");
  const ParameterLayout layout = *ParameterLayout::all_tables(machine.chain, machine.nodes);
  std::mt19937_64 random(2);
  const Eigen::VectorXd U = random_tables(layout, 1e-4, random);
  return *VolumetricModel::from_vector(layout, ModelDatum::G1, tools, U,
                                       Eigen::MatrixXd::Identity(U.size(), U.size()),
                                       whole_volume(layout));
}

TEST(VolumetricModel, OfToolsOnALineHoldsForToolsOnThatLineOnly) {
  const std::vector<Vector3> two{{0, 0, 0}, {0.1, 0, 0}},
      three{{0, 0, 0}, {0.1, 0, 0}, {0.3, 1e-4, 0}};
  for (const VolumetricModel& model : {of_18_tables(two), of_18_tables(three)}) {
    EXPECT_TRUE(model.holds_for_tool({0.2, 0, 0}));
    EXPECT_FALSE(model.holds_for_tool({0.1, 0.05, 0}));
    EXPECT_TRUE(model.error_at(Vector3::Zero(), {0.2, 0, 0.05}).V_m.array().isNaN().all());
    // Near the line: the rotation about it, which the tools do not determine, must not count.
    EXPECT_EQ(model.V_at({0.1, 0.1, -0.1}, {0.2, 0, 4e-4}),
              model.V_at({0.1, 0.1, -0.1}, {0.2, 0, 0}));
  }
}

TEST(VolumetricModel, OfOneToolGivenTwiceHoldsForThatOne) {
  const VolumetricModel model = of_18_tables({{0, 0, 0}, {1e-4, 0, 0}, {0, 1e-4, 0}});
  EXPECT_TRUE(model.holds_for_tool({0, 0, 4e-4}));
  EXPECT_FALSE(model.holds_for_tool({0.1, 0, 0}));
}

TEST(VolumetricModel, CorrectionBringsAPoorMachineToTheNominalPoint) {
  const VolumetricModel model = model_of(random_model(1e-3));  // errors of some mm
  const Vector3 p(0.11, -0.03, -0.22);
  const Result<Correction> correction = model.command_correction(p, kTool);
  ASSERT_TRUE(correction) << correction.error().text;
  const Vector3 commanded = p + correction->c_m;
  EXPECT_LT((commanded + model.V_at(commanded, kTool) - p).norm(), 1e-9);
  EXPECT_GT(correction->evaluations, 2);
}

TEST(VolumetricModel, CorrectionNamesAnotherToolInMillimetres) {
  const auto refused =
      model_of(random_model(1e-4)).command_correction({0, 0, 0}, {0.02, -0.015, -0.2});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().text.find("correction for tool offset (20, -15, -200) mm"), 0u)
      << refused.error().text;
}

TEST(VolumetricModel, CorrectionRefusesAnotherToolAndNonsenseTables) {
  EXPECT_EQ(model_of(random_model(1e-4)).command_correction({0, 0, 0}, {0, 0, 0}).error().code,
            ErrorCode::NotApplicable);
  EXPECT_EQ(model_of(random_model(1.0)).command_correction({0.1, 0.1, -0.1}, kTool).error().code,
            ErrorCode::NotConverged);
}

TEST(VolumetricModel, ComesBackFromItsDescriptionBitForBit) {
  const VolumetricModel model = model_of(random_model(1e-4));
  const Result<VolumetricModel> again = VolumetricModel::from_description(model.description());
  ASSERT_TRUE(again) << again.error().text;
  EXPECT_EQ(again->U(), model.U());
  const Vector3 q(0.2, 0.1, -0.1);
  EXPECT_EQ(again->error_at(q, kTool).V_m, model.error_at(q, kTool).V_m);
  EXPECT_EQ(again->error_at(q, kTool).cov_V_m2, model.error_at(q, kTool).cov_V_m2);
  EXPECT_EQ(again->validity().vertices_m().size(), model.validity().vertices_m().size());
}

TEST(VolumetricModel, NamesItsParametersWithUncertainty) {
  const Made m = random_model(1e-4);
  const std::vector<Parameter> parameters = model_of(m).parameters();
  EXPECT_EQ(parameters.front().name, "EXX");
  EXPECT_EQ(parameters.front().position_m, -0.3);
  EXPECT_EQ(parameters.back().name, "EC0Y");
  EXPECT_TRUE(parameters.back().is_angle());
  EXPECT_EQ(parameters[4].u, std::sqrt(m.covariance(4, 4)));
}

TEST(VolumetricModel, RefusesADescriptionThatDoesNotAddUp) {
  const ModelDescription good = model_of(random_model(1e-4)).description();
  const auto code_of = [](const ModelDescription& d) {
    return VolumetricModel::from_description(d).error().code;
  };

  ModelDescription d = good;
  d.parameters.pop_back();

  EXPECT_EQ(code_of(d), ErrorCode::BadInput);
  d = good;
  d.parameters[3].name = "EXQ";
  EXPECT_EQ(code_of(d), ErrorCode::BadInput);
  d = good;
  d.parameters[3].value = std::nan("");
  EXPECT_EQ(code_of(d), ErrorCode::NotFinite);
  d = good;
  d.covariance(0, 1) += 1.0;
  EXPECT_EQ(code_of(d), ErrorCode::BadInput);
  d = good;
  d.tool_offsets_m.clear();
  EXPECT_EQ(code_of(d), ErrorCode::BadInput);
}

/// No single variance is negative; that of the difference of two parameters is.
TEST(VolumetricModel, RefusesACovarianceThatIsNotPositive) {
  ModelDescription d = model_of(random_model(1e-4)).description();
  EXPECT_TRUE(check_covariance(d.covariance));
  d.covariance(4, 5) = d.covariance(5, 4) =
      1.01 * std::sqrt(d.covariance(4, 4) * d.covariance(5, 5));
  const auto refused = VolumetricModel::from_description(d);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::BadInput);
  EXPECT_NE(refused.error().text.find("positive semidefinite"), std::string::npos);
}

TEST(VolumetricModel, AcceptsTheCovarianceOfFixedAndOfFullyCorrelatedValues) {
  ModelDescription d = model_of(random_model(1e-4)).description();
  const Eigen::VectorXd one = d.covariance.col(0);
  d.covariance = one * one.transpose();
  d.covariance.row(3).setZero();
  d.covariance.col(3).setZero();
  EXPECT_TRUE(VolumetricModel::from_description(d));
}

TEST(VolumetricModel, OfTablesHasTheirNodesAndNoPolynomials) {
  const Made m = random_model(1e-4);
  const VolumetricModel model = model_of(m);
  ASSERT_NE(model.tables(), nullptr);
  EXPECT_EQ(model.polynomials(), nullptr);
  EXPECT_EQ(model.nodes()[0].nodes_m, m.layout.nodes()[0].nodes_m);
  EXPECT_EQ(model.chain().text(), m.layout.chain().text());
  EXPECT_TRUE(model.linear_between_nodes());
}

/// The nodes of polynomials are a grid over the bounding box of the validity volume.
TEST(VolumetricModel, OfPolynomialsHasNodesOverItsVolumeAndNoTables) {
  const Made m = random_model(1e-4);
  const auto design = ScaledDesign::of(m.layout.chain(), 2, {{0.0, 0.0, -0.2}, {0.3, 0.25, 0.2}});
  const auto n = static_cast<Eigen::Index>(design->size());
  const auto polynomials =
      PolynomialModel::of(*design, Vector3::Zero(), Eigen::VectorXd::Constant(n, 1e-5),
                          Eigen::MatrixXd::Identity(n, n) * 1e-12);
  const auto model = VolumetricModel::from_polynomials(*polynomials, ModelDatum::Ball1, kTool,
                                                       whole_volume(m.layout));
  ASSERT_TRUE(model) << model.error().text;
  EXPECT_EQ(model->tables(), nullptr);
  EXPECT_NEAR(model->nodes()[0].nodes_m.front(), m.layout.nodes()[0].nodes_m.front(), 1e-9);
  EXPECT_EQ(model->chain().text(), m.layout.chain().text());
  EXPECT_FALSE(model->linear_between_nodes());
}

TEST(RigidFreeDifference, IsZeroBetweenTwoDatumsOfOneMachine) {
  const Made m = random_model(1e-4);
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(m.layout.fit_size()));
  U.head(m.U.size()) = m.U;
  Made other = m;
  other.U = to_datum(ModelDatum::G1, m.layout, std::array{kTool}, U)->head(m.U.size());
  const auto difference =
      rigid_free_difference(model_of(m), model_of(other), kTool, tensor_grid(m.layout.nodes()));
  ASSERT_TRUE(difference);
  EXPECT_GT(difference->as_stated.mean_m, 1e-5);
  EXPECT_LT(difference->rigid_free.max_m, 1e-15);
}

TEST(RigidFreeDifference, RefusesAToolOneModelDoesNotKnow) {
  const Made m = random_model(1e-4);
  const auto difference =
      rigid_free_difference(model_of(m), model_of(m), {0, 0, 0}, tensor_grid(m.layout.nodes()));
  ASSERT_FALSE(difference);
  EXPECT_EQ(difference.error().code, ErrorCode::NotApplicable);
}

}  // namespace

// What the tables and the grid of a control hold of a correction.
#include "abbe/calib/export/held_correction.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "abbe/calib/model/model_comparison.hpp"

namespace abbe::tests::held {
namespace {
using namespace abbe::calib;

/// Second order of c = -V(p + c) in these models: |V| up to 30 um, |dV/dq| up to 6e-4.
constexpr double kOneStep_m = 2e-8;

/// 15 um and 15 urad at the nodes, where `wanted` is true of the error; 0 elsewhere.
VolumetricModel random_model(const std::function<bool(const std::string&)>& wanted,
                             const std::string& chain = "[w X' b Y Z t]") {
  const auto x = equidistant_nodes(-0.3, 0.3, 0.15).value();
  const auto z = equidistant_nodes(-0.4, -0.1, 0.1).value();
  const auto layout =
      ParameterLayout::observable_with_one_target(KinematicChain::parse(chain).value(), {x, x, z})
          .value();
  std::mt19937 random(4);
  std::uniform_real_distribution<double> value(-15e-6, 15e-6);
  const auto n = static_cast<Eigen::Index>(layout.model_size());
  Eigen::VectorXd U(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::string label = layout.label(static_cast<std::size_t>(i));
    const double drawn = value(random);
    U[i] = wanted(label.substr(0, label.find(' '))) ? drawn : 0.0;
  }

  std::vector<Vector3> corners;
  for (const double cx : {-0.3, 0.3}) {
    for (const double cy : {-0.3, 0.3}) {
      for (const double cz : {-0.4, -0.1}) corners.emplace_back(cx, cy, cz);
    }
  }
  const std::vector<Vector3> tools{{0.02, -0.015, -0.12}};
  return VolumetricModel::from_vector(layout, ModelDatum::G1, tools, U, Eigen::MatrixXd::Zero(n, n),
                                      ValidityVolume::hull_of(corners).value())
      .value();
}

const Vector3 kTool(0.02, -0.015, -0.12);

bool every(const std::string&) {
  return true;
}
bool is_translation(const std::string& error) {
  return error[1] <= 'Z' && error[1] >= 'X';
}

GridAxes nodes_of(const VolumetricModel& model, const NodeOptions& options = {}) {
  return export_nodes(model, export_box(model).value(), options).value();
}

std::vector<ExportPlace> places_of(const VolumetricModel& model) {
  return random_places(model, export_box(model).value(), 300, 2).value();
}

/// Sum of squares of c - c_held at the nodes.
double misfit(const VolumetricModel& model, const HeldTables& held) {
  double sum = 0.0;
  for (const Vector3& p : tensor_grid(model.nodes())) {
    sum += (model.command_correction(p, kTool)->c_m - held.c_m(p)).squaredNorm();
  }
  return sum;
}

TEST(HeldCorrection, TablesOfTheModelAreMinusV) {
  for (const char* chain : {"[w X' b Y Z t]", "[w b Z Y X t]", "[w Y' b X Z t]"}) {
    const auto model = random_model(every, chain);
    const auto held = tables_of_model(model, kTool, nodes_of(model)).value();
    for (const ExportPlace& place : places_of(model)) {
      const Vector3 V_m = model.V_at(place.commanded_m, kTool);
      ASSERT_LT((held.c_m(place.commanded_m) + V_m).norm(), 1e-15) << chain;
    }
  }
}

TEST(HeldCorrection, TranslationsAreHeldByTheirTables) {
  const auto model = random_model(is_translation);
  const auto held = fit_tables(model, kTool, translation_motions(), nodes_of(model), false).value();
  const auto loss = export_loss(model, kTool, places_of(model), {}, [&](const ExportPlace& place) {
    return held.c_m(place.commanded_m, place.travel);
  });
  EXPECT_LT(loss->max_lost_m.maxCoeff(), kOneStep_m);
  EXPECT_GT(loss->rms_without_m.minCoeff(), 1e-6);
}

TEST(HeldCorrection, NoOtherTablesFitBetter) {
  const auto model = random_model(every);
  auto held = fit_tables(model, kTool, positioning_motions(), nodes_of(model), false).value();
  const double best = misfit(model, held);
  for (HeldTable& table : held.tables) {
    for (double& value : table.value) {
      for (const double change_m : {1e-7, -1e-7}) {
        value += change_m;
        EXPECT_GT(misfit(model, held), best) << name(table.motion);
        value -= change_m;
      }
    }
  }
}

TEST(HeldCorrection, ErrorsThatAFormatDoesNotHoldAreLost) {
  const auto model = random_model(every);
  const auto box = export_box(model).value();
  const auto losses = losses_by_error(model, kTool, positioning_motions(), box).value();
  for (const ErrorLoss& loss : losses) {
    if (loss.name == "EXX" || loss.name == "EYY" || loss.name == "EZZ") {
      EXPECT_LT(loss.rms_lost_m, 1e-3 * loss.rms_m) << loss.name;
    }
    // EXZ moves X as a function of Z: only its mean is in the table of X.
    if (loss.name == "EXZ") {
      EXPECT_GT(loss.rms_lost_m, 0.3 * loss.rms_m);
    }
  }
  EXPECT_EQ(losses.size(), 17);  // 14 tables and 3 squareness errors
}

TEST(HeldCorrection, BacklashIsInTheTableOfItsAxis) {
  auto description = random_model(is_translation).description();
  const auto layout =
      ParameterLayout::observable_with_one_target(description.chain, description.nodes).value();
  const auto kind = TravelDependence::Backlash;
  TableOptions options;
  options.travel = kind;
  const auto basis = TableBasis::of(layout, options).value();
  const auto n = static_cast<Eigen::Index>(layout.model_size());
  const auto m = static_cast<Eigen::Index>(basis.size()) - n;
  Eigen::VectorXd D = Eigen::VectorXd::Zero(m);
  D[0] = 6e-6;  // of EXX
  description.travel =
      TravelDifferences{kind, D, Eigen::MatrixXd::Zero(m, m), Eigen::MatrixXd::Zero(n, m)};
  const Eigen::MatrixXd half = half_differences(basis, D);
  description.covariance += half * half.transpose();
  const auto model = VolumetricModel::from_description(std::move(description)).value();

  const auto held = fit_tables(model, kTool, positioning_motions(), nodes_of(model), true).value();
  for (const double half_forward : held.tables[0].half_forward) {
    EXPECT_NEAR(half_forward, -3e-6, kOneStep_m);
  }
  for (const double half_forward : held.tables[1].half_forward) {
    EXPECT_NEAR(half_forward, 0.0, kOneStep_m);
  }
}

TEST(HeldCorrection, AGridHoldsItsNodes) {
  const auto model = random_model(every);
  const auto grid = grid_of_model(model, kTool, nodes_of(model), {}).value();
  for (const Vector3& p : tensor_grid(model.nodes())) {
    ASSERT_LT((grid.c_m(p) - model.command_correction(p, kTool)->c_m).norm(), 1e-15);
  }
}

TEST(HeldCorrection, NodesAreThoseOfTheTablesOrEqualSteps) {
  const auto model = random_model(every);
  EXPECT_EQ(nodes_of(model)[0], model.nodes()[0].nodes_m);
  NodeOptions options;
  options.step_m = 0.07;
  const auto steps = nodes_of(model, options);
  EXPECT_EQ(steps[0].size(), 10);  // 0.6 m in 9 steps
  EXPECT_EQ(steps[0].front(), -0.3);
  EXPECT_EQ(steps[0].back(), 0.3);

  const auto part = export_box(model, ExportBox{{-0.2, -0.2, -0.3}, {0.1, 0.2, -0.2}}).value();
  const std::vector<double> inside{-0.2, -0.15, 0.0, 0.1};
  EXPECT_EQ(export_nodes(model, part, {})->at(0), inside);
}

TEST(HeldCorrection, NothingIsExtrapolated) {
  const auto model = random_model(every);
  const auto beyond = export_box(model, ExportBox{{-0.3, -0.3, -0.4}, {0.3, 0.3, 0.0}});
  ASSERT_FALSE(beyond);
  EXPECT_EQ(beyond.error().code, ErrorCode::BadInput);
  EXPECT_FALSE(export_box(model, ExportBox{{0.1, -0.3, -0.4}, {0.1, 0.3, -0.1}}));
  NodeOptions options;
  options.step_m = -1.0;
  EXPECT_FALSE(export_nodes(model, export_box(model).value(), options));
}

}  // namespace
}  // namespace abbe::tests::held

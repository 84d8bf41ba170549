#include "abbe/calib/model/model_datum.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>

#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::tests::otf;

const Vector3 kTarget(0.02, -0.015, -0.12);
const std::vector<Vector3> kThreeTargets{kTarget, {0.1, 0.03, -0.05}, {-0.04, 0.09, -0.2}};

/// Nullity of complete 3D data, by singular values: `extra_runs` adds three unknown offset
/// corrections for every target but the first; `keep` chooses columns.
std::size_t nullity(const ParameterLayout& layout, std::span<const Vector3> targets,
                    bool unknown_offsets, const std::function<bool(std::size_t)>& keep) {
  const std::vector<Vector3> grid = tensor_grid(layout.nodes());
  const std::size_t columns = layout.fit_size() + (unknown_offsets ? 3 * (targets.size() - 1) : 0);
  const auto n = static_cast<Eigen::Index>(columns);
  Eigen::MatrixXd A =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(3 * grid.size() * targets.size()), n);
  Eigen::Index row = 0;
  for (std::size_t run = 0; run < targets.size(); ++run) {
    for (const Vector3& q : grid) {
      const DesignColumns design = design_columns_with_rigid(layout, q, targets[run]);
      for (const Column& c : design.span()) {
        A.block<3, 1>(row, static_cast<Eigen::Index>(c.parameter)) = c.dV_dU;
      }
      if (unknown_offsets && run > 0) {
        A.block<3, 3>(row, static_cast<Eigen::Index>(layout.fit_size() + 3 * (run - 1)))
            .setIdentity();
      }
      row += 3;
    }
  }
  std::vector<Eigen::Index> kept;
  for (std::size_t i = 0; i < columns; ++i) {
    if (keep(i)) {
      kept.push_back(static_cast<Eigen::Index>(i));
    }
  }
  const Eigen::MatrixXd chosen = A(Eigen::all, kept);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(chosen.transpose() * chosen,
                                                             Eigen::EigenvaluesOnly);
  return static_cast<std::size_t>(
      (eigen.eigenvalues().array() < 1e-11 * eigen.eigenvalues().maxCoeff()).count());
}

const auto everything = [](std::size_t) { return true; };

class Nullity : public testing::TestWithParam<const char*> {
 protected:
  otf::Machine machine_ = coarse_machine(GetParam());
  ParameterLayout one_target_ = layout_of(machine_);
  ParameterLayout all_ = *ParameterLayout::all_tables(machine_.chain, machine_.nodes);
};
INSTANTIATE_TEST_SUITE_P(Chains, Nullity,
                         testing::Values("[w b X Y Z t]", "[w b X Z Y t]", "[w b Y X Z t]",
                                         "[w b Y Z X t]", "[w b Z X Y t]", "[w b Z Y X t]"));

TEST_P(Nullity, Of14TablesSquarenessAndRigidIs20) {
  EXPECT_EQ(nullity(one_target_, std::array{kTarget}, false, everything), 20u);
}

TEST_P(Nullity, Of14TablesAndSquarenessIs14) {
  EXPECT_EQ(nullity(one_target_, std::array{kTarget}, false,
                    [&](std::size_t i) { return i < one_target_.rigid_offset(); }),
            14u);
}

TEST_P(Nullity, Of14TablesAloneIs11) {
  EXPECT_EQ(nullity(one_target_, std::array{kTarget}, false,
                    [&](std::size_t i) { return i < one_target_.squareness_offset(); }),
            11u);
}

TEST_P(Nullity, Of18TablesAndOneTargetGrowsWithTheNodesOfTheLastAxes) {
  const std::array<Axis, 3>& order = machine_.chain.order_w_to_t();
  EXPECT_EQ(nullity(all_, std::array{kTarget}, false, everything),
            20 + all_.node_count(order[1]) + 3 * all_.node_count(order[2]));
}

TEST_P(Nullity, Of18TablesAndThreeKnownTargetsIs21) {
  EXPECT_EQ(nullity(all_, kThreeTargets, false, everything), 21u);
}

TEST_P(Nullity, Of18TablesAndThreeTargetsOfUnknownOffsetIs24) {
  EXPECT_EQ(nullity(all_, kThreeTargets, true, everything), 24u);
}

TEST_P(Nullity, IsSpannedByTheUnobservableCombinations) {
  const Eigen::MatrixXd N = unobservable_combinations(one_target_, std::array{kTarget});
  ASSERT_EQ(N.cols(), 20);
  const DesignColumns design =
      design_columns_with_rigid(one_target_, Vector3(0.11, -0.13, -0.17), kTarget);
  Eigen::MatrixXd seen = Eigen::MatrixXd::Zero(3, 20);
  for (const Column& c : design.span()) {
    seen += c.dV_dU * N.row(static_cast<Eigen::Index>(c.parameter));
  }
  EXPECT_LT(seen.norm(), 1e-11 * N.norm());
}

TEST_P(Nullity, IsRemovedExactlyByDatumG1) {
  const Eigen::MatrixXd K = datum_conditions(ModelDatum::G1, one_target_);
  EXPECT_EQ(K.rows(), 20);
  const Eigen::MatrixXd KN =
      K * unobservable_combinations(one_target_, std::array{kTarget}).colwise().normalized();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factor(KN);
  EXPECT_EQ(factor.setThreshold(1e-9).rank(), 20);
}

/// Nodes computed from range and spacing are rounded: a node 1e-17 m from the reference is at the
/// reference.
TEST(DatumG1, FixesTheNodeAtTheReferenceAloneForEveryRangeAndSpacing) {
  std::size_t beside = 0;
  for (int half_mm = 10; half_mm <= 1500; half_mm += 10) {
    for (const int spacing_mm : {10, 15, 20, 25, 30, 40, 45, 50, 60, 75, 100, 150}) {
      for (const int low_mm : {-half_mm, -half_mm / 2, -half_mm / 6}) {
        otf::Machine machine = case_a_machine();
        machine.nodes[0] = *equidistant_nodes(1e-3 * low_mm, 1e-3 * half_mm, 1e-3 * spacing_mm);
        const auto& nodes = machine.nodes[0].nodes_m;
        const bool at_node =
            std::any_of(nodes.begin(), nodes.end(), [](double x) { return std::abs(x) < 1e-12; });
        beside += std::any_of(nodes.begin(), nodes.end(),
                              [](double x) { return x != 0.0 && std::abs(x) < 1e-12; });
        const ParameterLayout layout = *ParameterLayout::with_tables(
            machine.chain, machine.nodes, std::array{ErrorMotion{Motion::X, Axis::X}});
        const Eigen::MatrixXd K = datum_conditions(ModelDatum::G1, layout);
        ASSERT_EQ((K.array() != 0.0).count(), at_node ? 1 : 2)
            << low_mm << " to " << half_mm << " every " << spacing_mm;
      }
    }
  }

  EXPECT_GT(beside, 50u);  // the ranges that this test checks
}

TEST(DatumG1, Has24ConditionsFor18Tables) {
  const otf::Machine machine = case_a_machine();
  EXPECT_EQ(
      datum_conditions(ModelDatum::G1, *ParameterLayout::all_tables(machine.chain, machine.nodes))
          .rows(),
      24);
}

TEST(DatumG1, ConversionMeetsTheConditionsAndChangesNoMeasurement) {
  const otf::Machine machine = coarse_machine("[w X' b Y Z t]");
  const ParameterLayout layout = layout_of(machine);
  std::mt19937_64 random(5);
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.fit_size()));
  U.head(static_cast<Eigen::Index>(layout.model_size())) = random_tables(layout, 1e-4, random);
  const Eigen::VectorXd G1 = *to_datum(ModelDatum::G1, layout, std::array{kTarget}, U);
  EXPECT_LT((datum_conditions(ModelDatum::G1, layout) * G1).norm(), 1e-15);
  const DesignColumns design = design_columns_with_rigid(layout, Vector3(0.2, 0.1, -0.05), kTarget);
  Vector3 change = Vector3::Zero();

  for (const Column& c : design.span()) {
    change += c.dV_dU * (G1 - U)(static_cast<Eigen::Index>(c.parameter));
  }

  EXPECT_LT(change.norm(), 1e-15);
}

/// 18 tables, three tools: combinations that a single tool leaves undetermined do not change.
TEST(DatumG1, ConversionOf18TablesKeepsWhatEveryToolMeasures) {
  const otf::Machine machine = coarse_machine("[w X' b Y Z t]");
  const ParameterLayout layout = *ParameterLayout::all_tables(machine.chain, machine.nodes);
  std::mt19937_64 random(5);
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.fit_size()));
  const auto n = static_cast<Eigen::Index>(layout.model_size());
  U.head(n) = random_tables(layout, 1e-4, random);
  const Result<Eigen::VectorXd> G1 = to_datum(ModelDatum::G1, layout, kThreeTargets, U);
  ASSERT_TRUE(G1) << G1.error().text;
  EXPECT_LT((datum_conditions(ModelDatum::G1, layout) * *G1).norm(), 1e-15);
  const Eigen::VectorXd moved = *G1 - U;

  for (const Vector3& t : {kThreeTargets[1], Vector3(0.3, -0.2, 0.1)}) {
    std::vector<Vector3> points, change;
    for (const Vector3& q : tensor_grid(machine.nodes)) {
      points.push_back(q + t);
      change.push_back(volumetric_error(layout, {moved.data(), layout.model_size()}, q, t));
    }
    EXPECT_LT(rigid_free(points, change)->rigid_free.max_m, 1e-15);
  }
}

TEST(DatumG1, Of18TablesNeedsThreeToolsThatAreNotOnALine) {
  const otf::Machine machine = coarse_machine("[w X' b Y Z t]");
  const ParameterLayout layout = *ParameterLayout::all_tables(machine.chain, machine.nodes);
  const Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.fit_size()));
  const Vector3 step(0.1, 0.0, 0.05);
  for (const auto& tools :
       {std::vector{kTarget}, std::vector{kTarget, Vector3(kTarget + step)},
        std::vector{kTarget, Vector3(kTarget + step), Vector3(kTarget - step)}}) {
    const Result<Eigen::VectorXd> G1 = to_datum(ModelDatum::G1, layout, tools, U);
    ASSERT_FALSE(G1) << tools.size();
    EXPECT_EQ(G1.error().code, ErrorCode::DegenerateGeometry);
  }
}

TEST(DatumG1, LeavesTheReferenceTablesAsTheyAre) {
  const otf::Machine machine = case_a_machine();
  const ParameterLayout layout = layout_of(machine);
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.fit_size()));
  U.head(163) = case_a_tables(TableColumn::Truth);
  EXPECT_LT((datum_conditions(ModelDatum::G1, layout) * U).cwiseAbs().maxCoeff(), 1e-15);
}

/// A machine whose axes are far from machine zero.
otf::Machine machine_far_from_zero() {
  otf::Machine machine = coarse_machine("[w X' b Y Z t]");
  for (AxisNodes& axis : machine.nodes) {
    axis = *equidistant_nodes(2.8, 3.2, 0.1);
    axis.reference_m = 3.0;
  }
  return machine;
}

VolumetricModel model_in(ModelDatum datum, const otf::Machine& machine, const Eigen::VectorXd& U) {
  const ParameterLayout layout = layout_of(machine);
  return *VolumetricModel::from_vector(layout, datum, std::array{machine.target_offset_m}, U,
                                       1e-14 * Eigen::MatrixXd::Identity(U.size(), U.size()),
                                       *ValidityVolume::hull_of(tensor_grid(machine.nodes)));
}

TEST(DatumG2, SquarenessActsOnTheDistanceFromTheReferencePosition) {
  const otf::Machine machine = machine_far_from_zero();
  const ParameterLayout layout = layout_of(machine);
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.model_size()));
  U.tail<3>() = Vector3(20e-6, -30e-6, 40e-6);
  const VolumetricModel G1 = model_in(ModelDatum::G1, machine, U),
                        G2 = model_in(ModelDatum::G2, machine, U);
  const Vector3 reference_m = Vector3::Constant(3.0), t = machine.target_offset_m;
  EXPECT_EQ(G2.V_at(reference_m, t), Vector3(Vector3::Zero()));
  EXPECT_LT(std::sqrt(G2.error_at(reference_m, t).cov_V_m2.trace()), 1e-6);

  const Vector3 constant_m = G1.V_at(reference_m, t);
  EXPECT_NEAR(constant_m.x(), -40e-6 * 3.0 - 30e-6 * 3.0, 1e-15);
  EXPECT_NEAR(constant_m.y(), -20e-6 * 3.0, 1e-15);
  for (const Vector3& q : tensor_grid(machine.nodes)) {
    EXPECT_LT((G1.V_at(q, t) - G2.V_at(q, t) - constant_m).norm(), 1e-15);
  }
}

TEST(DatumG2, AStoredModelKeepsItsDatum) {
  const otf::Machine machine = machine_far_from_zero();
  const ParameterLayout layout = layout_of(machine);
  const Eigen::VectorXd U =
      Eigen::VectorXd::Constant(static_cast<Eigen::Index>(layout.model_size()), 1e-5);
  const Vector3 q_m(2.9, 3.1, 3.0);
  for (const ModelDatum datum : {ModelDatum::G1, ModelDatum::G2}) {
    const VolumetricModel model = model_in(datum, machine, U);
    const VolumetricModel read = *VolumetricModel::from_description(model.description());
    EXPECT_EQ(read.datum(), datum);
    EXPECT_EQ(read.V_at(q_m, machine.target_offset_m), model.V_at(q_m, machine.target_offset_m));
  }
}

}  // namespace

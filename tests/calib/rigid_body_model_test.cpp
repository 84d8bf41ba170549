#include "abbe/calib/internal/geometry/rigid_body_model.hpp"

#include <gtest/gtest.h>

#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::tests::otf;

Vector3 three(const std::vector<double>& v, std::size_t from) {
  return {v.at(from), v.at(from + 1), v.at(from + 2)};
}

// The reference is printed with 13 significant digits of values of 1e-4 m: 1e-12 m is far above the
// rounding.
TEST(RigidBodyModel, GivesTheReferenceErrorsAt50Points) {
  const otf::Machine machine = case_a_machine();
  const ParameterLayout layout = layout_of(machine);
  const Eigen::VectorXd U = case_a_tables(TableColumn::Truth);
  const std::vector<ReferenceRow> points = read_rows(small_file("caseA_V_true_at_points.csv"));
  ASSERT_EQ(points.size(), 50u);
  for (const ReferenceRow& row : points) {
    const Vector3 V = volumetric_error(layout, {U.data(), layout.model_size()},
                                       three(row.values, 0), machine.target_offset_m);
    EXPECT_LT((V - three(row.values, 3)).norm(), 1e-12);
  }
}

// Second order in the errors: 0.052 um at most at 103 um mean error.
TEST(RigidBodyModel, DiffersFromTheExactTransformsInSecondOrderOnly) {
  const otf::Machine machine = case_a_machine();
  const ParameterLayout layout = layout_of(machine);
  const Eigen::VectorXd U = case_a_tables(TableColumn::Truth);
  for (const ReferenceRow& row : read_rows(small_file("caseA_V_true_at_points.csv"))) {
    const Vector3 V = volumetric_error(layout, {U.data(), layout.model_size()},
                                       three(row.values, 0), machine.target_offset_m);
    EXPECT_LT((V - three(row.values, 6)).norm(), 0.053e-6);
  }
}

class AnyOrder : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Chains, AnyOrder,
                         testing::Values("[w b X Y Z t]", "[w b X Z Y t]", "[w b Y X Z t]",
                                         "[w b Y Z X t]", "[w b Z X Y t]", "[w b Z Y X t]"));

TEST_P(AnyOrder, ColumnsTimesParametersAreTheError) {
  const otf::Machine machine = coarse_machine(GetParam());
  const ParameterLayout layout = *ParameterLayout::all_tables(machine.chain, machine.nodes);
  std::mt19937_64 random(3);
  const Eigen::VectorXd U = random_tables(layout, 1e-4, random);
  const Vector3 q(0.12, -0.07, -0.31), t(0.02, -0.015, -0.12);
  Vector3 sum = Vector3::Zero();
  const DesignColumns columns = design_columns(layout, q, t);
  for (const Column& c : columns.span()) {
    sum += c.dV_dU * U(static_cast<Eigen::Index>(c.parameter));
  }
  EXPECT_LT((sum - volumetric_error(layout, {U.data(), layout.model_size()}, q, t)).norm(), 1e-18);
}

/// As in an exact product of transforms, a rotation of one axis also rotates the travel of all axes
/// nearer to the tool.
TEST_P(AnyOrder, ARotationTurnsWhatIsNearerToTheTool) {
  const otf::Machine machine = coarse_machine(GetParam());
  const Vector3 q(0.1, -0.2, -0.3), t(0.01, 0.02, 0.03);
  for (const Axis a : kAllAxes) {
    Vector3 carried = t;
    for (const Axis b : kAllAxes) {
      if (machine.chain.place(b) > machine.chain.place(a)) {
        carried(static_cast<Eigen::Index>(index(b))) += q(static_cast<Eigen::Index>(index(b)));
      }
    }
    EXPECT_LT((lever(machine.chain, a, q, t) - carried).norm(), 1e-18);
  }
}

TEST(RigidBodyModel, SquarenessTiltsTheDirectionOfTravelOnly) {
  const ParameterLayout layout = layout_of(case_a_machine());
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.model_size()));
  U.tail<3>() << 1e-5, 2e-5, 3e-5;  // EA0Z EB0Z EC0Y
  const Vector3 q(0.1, 0.2, -0.3);
  const Vector3 V = volumetric_error(layout, {U.data(), layout.model_size()}, q, Vector3(5, 6, 7));
  EXPECT_LT((V - Vector3(-3e-5 * 0.2 + 2e-5 * -0.3, -1e-5 * -0.3, 0)).norm(), 1e-20);
}

TEST(RigidBodyModel, RigidColumnsAreTranslationAndRotationOfTheTarget) {
  const ParameterLayout layout = layout_of(case_a_machine());
  const Vector3 q(0.1, 0.2, -0.3), t(0.01, 0.02, 0.03), T(1e-5, 2e-5, 3e-5), r(4e-5, -5e-5, 6e-5);
  const DesignColumns columns = design_columns_with_rigid(layout, q, t);
  const std::span<const Column> rigid = columns.span().last(6);
  Vector3 moved = Vector3::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    moved += rigid[k].dV_dU * T(static_cast<Eigen::Index>(k)) +
             rigid[k + 3].dV_dU * r(static_cast<Eigen::Index>(k));
  }
  EXPECT_LT((moved - (T + r.cross(q + t))).norm(), 1e-20);
}

}  // namespace

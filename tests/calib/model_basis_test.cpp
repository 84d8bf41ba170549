#include "abbe/calib/internal/geometry/model_basis.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::estimation;
using namespace abbe::tests::otf;

constexpr std::array kAllLinear{Interpolation::Linear, Interpolation::Linear,
                                Interpolation::Linear};
constexpr std::array kAllCubic{Interpolation::NaturalCubic, Interpolation::NaturalCubic,
                               Interpolation::NaturalCubic};

Vector3 three_of(const std::vector<double>& v, std::size_t from) {
  return {v.at(from), v.at(from + 1), v.at(from + 2)};
}

/// The columns of a basis, in memory of their own.
class OwnColumns {
 public:
  explicit OwnColumns(const ModelBasis& basis) : memory_(basis.most_columns()), columns_(memory_) {}
  std::span<const Column> at(const ModelBasis& basis, const MachineState& state) {
    basis.columns(state, columns_);
    return columns_.span();
  }
  Vector3 times(const Eigen::VectorXd& U) const {
    Vector3 sum = Vector3::Zero();
    for (const Column& c : columns_.span()) {
      sum += c.dV_dU * U(static_cast<Eigen::Index>(c.parameter));
    }
    return sum;
  }

 private:
  std::vector<Column> memory_;
  ModelColumns columns_;
};

ModelBasis tables_of(const otf::Machine& machine, const TableOptions& options) {
  return ModelBasis(*TableBasis::of(layout_of(machine), options));
}

/// A state with all axes in motion: X forward, Y backward, Z not yet moved.
MachineState moving_state() {
  return {.q_m = {0.12, -0.07, -0.31},
          .tool_offset_m = {0.02, -0.015, -0.12},
          .travel = {Travel::Forward, Travel::Backward, Travel::Unknown}};
}

Eigen::VectorXd random_parameters(const ModelBasis& basis) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Eigen::VectorXd U(static_cast<Eigen::Index>(basis.size()));
  for (Eigen::Index i = 0; i < U.size(); ++i) {
    U(i) = 1e-4 * normal(random);
  }
  return U;
}

/// Largest difference to the reference file, whose columns 3 to 5 are V.
double largest_difference(const std::string& file, const TableOptions& options) {
  const otf::Machine machine = case_a_machine();
  const ModelBasis basis = tables_of(machine, options);
  const Eigen::VectorXd U = case_a_tables(TableColumn::Truth);
  OwnColumns columns(basis);
  double most = 0.0;
  for (const ReferenceRow& row : read_rows(small_file(file))) {
    columns.at(basis, {.q_m = three_of(row.values, 0), .tool_offset_m = machine.target_offset_m});
    most = std::max(most, (columns.times(U) - three_of(row.values, 3)).norm());
  }
  return most;
}

// The reference is printed with 13 significant digits of values of 1e-4 m.
TEST(ModelBasis, OfLinearTablesGivesTheReferenceErrorsAt50Points) {
  EXPECT_LT(largest_difference("caseA_V_true_at_points.csv", {}), 1e-12);
}

TEST(ModelBasis, OfCubicTablesGivesTheReferenceErrorsAt50Points) {
  EXPECT_LT(largest_difference("caseA_V_cubic_at_points.csv", {.interpolation = kAllCubic}), 1e-12);
}

TEST(ModelBasis, OfLinearTablesHasTheColumnsOfTheRigidBodyModelBitForBit) {
  const otf::Machine machine = coarse_machine("[w X' b Y Z t]");
  const ModelBasis basis = tables_of(machine, {});
  OwnColumns columns(basis);
  const MachineState state = moving_state();
  const std::span<const Column> found = columns.at(basis, state);
  const DesignColumns expected = design_columns(layout_of(machine), state.q_m, state.tool_offset_m);
  ASSERT_EQ(found.size(), expected.count);
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].parameter, expected.column[i].parameter);
    EXPECT_EQ(found[i].dV_dU, expected.column[i].dV_dU);
  }
}

struct NamedOptions {
  const char* name;
  TableOptions options;
};

class EveryTableForm : public testing::TestWithParam<NamedOptions> {
 protected:
  ModelBasis basis_ = tables_of(coarse_machine("[w b Y Z X t]"), GetParam().options);
};
INSTANTIATE_TEST_SUITE_P(
    Forms, EveryTableForm,
    testing::Values(NamedOptions{"Linear", {}}, NamedOptions{"Cubic", {kAllCubic}},
                    NamedOptions{"Backlash", {kAllLinear, TravelDependence::Backlash}},
                    NamedOptions{"TravelTables", {kAllLinear, TravelDependence::Tables}},
                    NamedOptions{"CubicTravelTables", {kAllCubic, TravelDependence::Tables}}),
    [](const auto& form) { return std::string(form.param.name); });

TEST_P(EveryTableForm, ColumnsTimesParametersAreTheError) {
  const Eigen::VectorXd U = random_parameters(basis_);
  OwnColumns columns(basis_);
  columns.at(basis_, moving_state());
  const Vector3 V = basis_.V_m(moving_state(), {U.data(), basis_.size()});
  EXPECT_LT((columns.times(U) - V).norm(), 1e-18);
}

TEST_P(EveryTableForm, ColumnsAscendAndFitIntoTheStatedMemory) {
  MachineState state = moving_state();
  state.travel.fill(Travel::Forward);
  OwnColumns columns(basis_);
  const std::span<const Column> found = columns.at(basis_, state);
  EXPECT_LE(found.size(), basis_.most_columns());
  EXPECT_LT(found.back().parameter, basis_.size());
  for (std::size_t i = 1; i < found.size(); ++i) {
    EXPECT_LT(found[i - 1].parameter, found[i].parameter);
  }
}

/// Error with X forward minus error with X backward.
Vector3 difference_of_travel(const ModelBasis& basis, const Eigen::VectorXd& U) {
  MachineState state = moving_state();
  const Vector3 forward = basis.V_m(state, {U.data(), basis.size()});
  state.travel[0] = Travel::Backward;
  return forward - basis.V_m(state, {U.data(), basis.size()});
}

TEST(ModelBasis, BacklashIsTheDifferenceBetweenForwardAndBackward) {
  const ModelBasis basis =
      tables_of(coarse_machine("[w b X Y Z t]"), {.travel = TravelDependence::Backlash});
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(basis.size()));
  const std::size_t first = basis.tables()->layout().model_size();
  U(static_cast<Eigen::Index>(first)) = 5e-6;  // of EXX
  EXPECT_LT((difference_of_travel(basis, U) - Vector3(5e-6, 0, 0)).norm(), 1e-20);
  EXPECT_EQ(basis.size(), first + basis.tables()->layout().tables().size());
  EXPECT_EQ(basis.label(first), "backlash of EXX");
}

TEST(ModelBasis, ForwardAndBackwardTablesDifferByTheirOwnNodes) {
  const ModelBasis basis =
      tables_of(coarse_machine("[w b X Y Z t]"), {.travel = TravelDependence::Tables});
  const ParameterLayout& layout = basis.tables()->layout();
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(basis.size()));
  for (std::size_t i = 0; i < layout.node_count(Axis::X); ++i) {  // of EXX: the position itself
    U(static_cast<Eigen::Index>(layout.model_size() + i)) = layout.nodes()[0].nodes_m[i];
  }
  EXPECT_NEAR(difference_of_travel(basis, U).x(), moving_state().q_m.x(), 1e-15);
  EXPECT_EQ(basis.label(layout.model_size()), "travel difference of EXX at -0.300 m");
}

TEST(ModelBasis, AnAxisThatHasNotMovedHasTheMeanOfBothDirections) {
  const ModelBasis basis =
      tables_of(coarse_machine("[w b X Y Z t]"), {.travel = TravelDependence::Backlash});
  const Eigen::VectorXd U = random_parameters(basis);
  MachineState state = moving_state();
  Vector3 sum = Vector3::Zero();
  for (const Travel travel : {Travel::Forward, Travel::Backward}) {
    state.travel[2] = travel;
    sum += basis.V_m(state, {U.data(), basis.size()});
  }
  state.travel[2] = Travel::Unknown;
  EXPECT_LT((basis.V_m(state, {U.data(), basis.size()}) - 0.5 * sum).norm(), 1e-18);
}

TEST(ModelBasis, OfPolynomialsHasTheColumnsOfTheScaledDesign) {
  const auto design = ScaledDesign::of(*KinematicChain::parse("[w b Z X Y t]"), 3,
                                       {{0.1, -0.2, 0.05}, {0.3, 0.2, 0.1}});
  const ModelBasis basis{PolynomialBasis(*design)};
  const MachineState state{.q_m = {0.21, -0.13, 0.02}};
  OwnColumns columns(basis);
  const Eigen::VectorXd c = random_parameters(basis);
  columns.at(basis, state);
  EXPECT_LT((columns.times(c) - design->B(state.q_m) * c).norm(), 1e-18);
  EXPECT_LT((basis.V_m(state, {c.data(), basis.size()}) - design->B(state.q_m) * c).norm(), 1e-18);
  EXPECT_EQ(basis.label(0), design->equivalent().names()[0]);
  EXPECT_EQ(basis.tables(), nullptr);
}

TEST(ModelBasis, RefusesACubicWithTooManyNodesAndNamesTheAxis) {
  otf::Machine machine = case_a_machine();
  machine.nodes[1] = *equidistant_nodes(-0.25, 0.25, 0.0005);
  const auto basis = TableBasis::of(layout_of(machine), {.interpolation = kAllCubic});
  ASSERT_FALSE(basis);
  EXPECT_EQ(basis.error().text.rfind("axis Y: nodes of an axis: 1001", 0), 0u)
      << basis.error().text;
}

}  // namespace

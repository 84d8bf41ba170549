// V of a model for a direction of travel: algebra, stored form, refused input.
#include "abbe/calib/geometry/travel_differences.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <utility>

#include "abbe/calib/joint/part.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/model/model_update.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::tests::otf;
using testing::HasSubstr;

constexpr auto kBack = Travel::Backward, kRest = Travel::Unknown, kForth = Travel::Forward;
const Vector3 kTravelTool(0.02, -0.015, -0.12), kTravelPlace(0.13, -0.11, -0.27);

/// A model with differences of some um, and the covariance of its tables and differences.
struct WithTravel {
  VolumetricModel model;
  TableBasis basis;
  Eigen::MatrixXd whole;
};

WithTravel model_with_travel(TravelDependence kind, Interpolation interpolation) {
  const ParameterLayout layout = layout_of(coarse_machine("[w X' b Y Z t]"));
  auto options = TableOptions::all_axes(interpolation);
  options.travel = kind;
  const auto basis = *TableBasis::of(layout, options);
  const auto n = static_cast<Eigen::Index>(layout.model_size()),
             all = static_cast<Eigen::Index>(basis.size());

  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd root(all, all);
  for (double& value : root.reshaped()) {
    value = 1e-7 * normal(random);
  }
  Eigen::VectorXd U(all);
  for (double& value : U) {
    value = 5e-6 * normal(random);
  }

  const Eigen::MatrixXd whole = root * root.transpose();
  const Eigen::MatrixXd half = half_differences(basis, U.tail(all - n));
  const auto mean = VolumetricModel::from_vector(
      layout, ModelDatum::G1, std::array{kTravelTool}, U.head(n),
      whole.topLeftCorner(n, n) + half * half.transpose(),
      *ValidityVolume::hull_of(tensor_grid(layout.nodes())), interpolation);
  return {*mean->with_travel({kind, U.tail(all - n), whole.bottomRightCorner(all - n, all - n),
                              whole.topRightCorner(n, all - n)}),
          basis, whole};
}

/// All columns at a state, dense.
Eigen::Matrix3Xd dense_columns(const TableBasis& basis, const AxisTravel& travel) {
  std::vector<Column> memory(basis.most_columns());
  ModelColumns columns(memory);
  basis.append_columns({.q_m = kTravelPlace, .tool_offset_m = kTravelTool, .travel = travel},
                       columns);
  Eigen::Matrix3Xd dense = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(basis.size()));
  for (const Column& c : columns.span()) {
    dense.col(static_cast<Eigen::Index>(c.parameter)) += c.dV_dU;
  }
  return dense;
}

Eigen::VectorXd all_values(const VolumetricModel& model) {
  Eigen::VectorXd U(model.U().size() + model.travel()->D.size());
  U << model.U(), model.travel()->D;
  return U;
}

using FormOfTravel = std::tuple<TravelDependence, Interpolation>;
class DirectionOfTravel : public testing::TestWithParam<FormOfTravel> {
 protected:
  const WithTravel made_ = model_with_travel(std::get<0>(GetParam()), std::get<1>(GetParam()));
};
INSTANTIATE_TEST_SUITE_P(
    Forms, DirectionOfTravel,
    testing::Combine(testing::Values(TravelDependence::Backlash, TravelDependence::Tables),
                     testing::Values(Interpolation::Linear, Interpolation::NaturalCubic)));

TEST_P(DirectionOfTravel, OfAllAxesGivesVOfAllParameters) {
  const Eigen::VectorXd U = all_values(made_.model);
  for (const AxisTravel travel : {AxisTravel{kForth, kForth, kForth}, {kBack, kForth, kBack}}) {
    const Eigen::Matrix3Xd J = dense_columns(made_.basis, travel);
    const VolumetricError e = made_.model.error_at(kTravelPlace, kTravelTool, travel);
    EXPECT_LT((e.V_m - J * U).norm(), 1e-17);
    EXPECT_LT((made_.model.V_at(kTravelPlace, kTravelTool, travel) - J * U).norm(), 1e-17);
    EXPECT_TRUE(e.cov_V_m2.isApprox(J * made_.whole * J.transpose(), 1e-9));
  }
}

/// Mean of the states forward and backward of Y: of V, and of the squares about this mean.
TEST_P(DirectionOfTravel, ThatIsNotKnownIsTheMeanOfBothWithTheirScatter) {
  const VolumetricModel& model = made_.model;
  const auto at = [&](Travel y) {
    return model.error_at(kTravelPlace, kTravelTool, {kForth, y, kBack});
  };
  const VolumetricError back = at(kBack), forth = at(kForth), unknown = at(kRest);
  const Vector3 half = 0.5 * (forth.V_m - back.V_m);
  const Matrix3 expected = 0.5 * (forth.cov_V_m2 + back.cov_V_m2) + half * half.transpose();
  EXPECT_LT((unknown.V_m - 0.5 * (forth.V_m + back.V_m)).norm(), 1e-17);
  EXPECT_TRUE(unknown.cov_V_m2.isApprox(expected, 1e-9));
  EXPECT_GT(half.norm(), 1e-6);
}

TEST_P(DirectionOfTravel, IsNotNeededForTheMean) {
  const VolumetricError mean = made_.model.error_at(kTravelPlace, kTravelTool),
                        unknown = made_.model.error_at(kTravelPlace, kTravelTool, {});
  EXPECT_EQ(mean.V_m, unknown.V_m);
  EXPECT_EQ(made_.model.V_at(kTravelPlace, kTravelTool, {}),
            made_.model.V_at(kTravelPlace, kTravelTool));
  EXPECT_GE((unknown.cov_V_m2 - mean.cov_V_m2).diagonal().minCoeff(), 0.0);
}

TEST_P(DirectionOfTravel, ComesBackFromTheDescriptionBitForBit) {
  const auto again = VolumetricModel::from_description(made_.model.description());
  ASSERT_TRUE(again) << again.error().text;
  ASSERT_NE(again->travel(), nullptr);
  EXPECT_EQ(again->travel()->D, made_.model.travel()->D);
  EXPECT_EQ(again->travel()->covariance, made_.model.travel()->covariance);
  EXPECT_EQ(again->travel()->cov_U_D, made_.model.travel()->cov_U_D);
  EXPECT_EQ(again->V_at(kTravelPlace, kTravelTool, {kBack, kBack, kForth}),
            made_.model.V_at(kTravelPlace, kTravelTool, {kBack, kBack, kForth}));
}

TEST_P(DirectionOfTravel, IsPartOfTheCorrectionOfACommand) {
  const AxisTravel travel{kBack, kForth, kForth};
  const auto c = made_.model.command_correction(kTravelPlace, kTravelTool, travel);
  ASSERT_TRUE(c) << c.error().text;
  const Vector3 left = c->c_m + made_.model.V_at(kTravelPlace + c->c_m, kTravelTool, travel);
  EXPECT_LT(left.norm(), 1e-9);
  EXPECT_GT((c->c_m - made_.model.command_correction(kTravelPlace, kTravelTool)->c_m).norm(), 1e-6);
}

TEST_P(DirectionOfTravel, IsRefusedWithAnotherCovariance) {
  ModelDescription d = made_.model.description();
  d.travel->cov_U_D *= 30.0;  // correlations above 1
  const auto refused = VolumetricModel::from_description(d);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("is not positive semidefinite together with"));
  EXPECT_EQ(made_.model.with_travel(*d.travel).error().text, refused.error().text);
  d = made_.model.description();
  d.travel->D.conservativeResize(3);
  EXPECT_THAT(VolumetricModel::from_description(d).error().text,
              HasSubstr("model: 3 differences between the directions of travel"));
  d = made_.model.description();
  d.travel->D(2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(VolumetricModel::from_description(d).error().code, ErrorCode::NotFinite);
}

/// Of an axis that moved in one direction only the prior remains: V is not known in either.
TEST(UndeterminedDifference, IsInTheUncertaintyOfEachDirection) {
  const WithTravel made = model_with_travel(TravelDependence::Backlash, Interpolation::Linear);
  TravelDifferences d = *made.model.travel();
  d.cov_U_D.col(0).setZero();  // EXX
  d.covariance.row(0).setZero();
  d.covariance.col(0).setZero();
  d.covariance(0, 0) = 1e-8;  // (100 um)^2
  const VolumetricModel model = *made.model.with_travel(d);
  for (const Travel x : {kBack, kRest, kForth}) {
    const auto e = model.error_at(kTravelPlace, kTravelTool, {x, kForth, kForth});
    EXPECT_GE(std::sqrt(e.cov_V_m2(0, 0)), 50e-6);
  }
}

/// An update, or common tables, would lose the differences without a message.
TEST(ModelWithDifferences, IsNeitherUpdatedNorJoined) {
  const WithTravel made = model_with_travel(TravelDependence::Backlash, Interpolation::Linear);
  ModelDescription d = made.model.description();
  d.travel.reset();
  const VolumetricModel without = *VolumetricModel::from_description(d);
  for (const auto& [previous, run] :
       {std::pair{&made.model, &without}, std::pair{&without, &made.model}}) {
    const auto updated = update_model(*previous, *run);
    ASSERT_FALSE(updated);
    EXPECT_EQ(updated.error().code, ErrorCode::NotApplicable);
    EXPECT_THAT(updated.error().text, HasSubstr("depends on the direction of travel"));
  }
  EXPECT_THAT(joint::tables_of(made.model).error().text,
              HasSubstr("depends on the direction of travel"));
}

TEST(ModelWithoutDifferences, IsTheSameInEveryDirection) {
  const WithTravel made = model_with_travel(TravelDependence::Backlash, Interpolation::Linear);
  ModelDescription d = made.model.description();
  d.travel.reset();
  const VolumetricModel model = *VolumetricModel::from_description(d);
  const VolumetricError e = model.error_at(kTravelPlace, kTravelTool),
                        forth = model.error_at(kTravelPlace, kTravelTool, {kForth, kForth, kForth});
  EXPECT_EQ(model.travel(), nullptr);
  EXPECT_EQ(e.V_m, forth.V_m);
  EXPECT_EQ(e.cov_V_m2, forth.cov_V_m2);
}

}  // namespace

#include "abbe/calib/estimation/datum.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "abbe/calib/internal/estimation/null_space.hpp"
#include "abbe/calib/model/model_datum.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::estimation;

/// Height differences of four points, whose common height nothing shows, measured with noise.
struct Levelling {
  Eigen::MatrixXd A{Eigen::MatrixXd(5, 4)};
  Eigen::VectorXd y{Eigen::VectorXd(5)};
  Levelling() {
    A << -1, 1, 0, 0,  //
        0, -1, 1, 0,   //
        0, 0, -1, 1,   //
        1, 0, 0, -1,   //
        -1, 0, 1, 0;
    y << 1.01, 2.02, -0.97, -2.0, 2.98;
  }
  [[nodiscard]] Information information() const {
    Information data(4);
    data.add_rows(A, y);
    return data;
  }
};

Datum first_point_is_zero() {
  return Datum(Eigen::RowVector4d(1, 0, 0, 0));
}

Datum mean_is_zero() {
  return Datum(Eigen::RowVector4d(1, 1, 1, 1));
}

TEST(Datum, IsMetWithoutAChangeOfTheFit) {
  const Levelling net;
  const Eigen::VectorXd fit = net.A * net.A.completeOrthogonalDecomposition().solve(net.y);
  for (const Datum& datum : {first_point_is_zero(), mean_is_zero()}) {
    const Result<DatumSolution> s = datum.solve(net.information());
    ASSERT_TRUE(s) << s.error().text;
    EXPECT_LT((datum.conditions() * s->U).norm(), 1e-15);
    EXPECT_LT((net.A * s->U - fit).norm(), 1e-14);
    EXPECT_EQ(s->rank, 3u);
    EXPECT_EQ(s->datum_defect, 1u);
  }
}

TEST(Datum, CovarianceOfTheMeanIsThePseudoInverse) {
  const Levelling net;
  const DatumSolution s = *mean_is_zero().solve(net.information());
  const Eigen::MatrixXd H = net.A.transpose() * net.A;
  const Eigen::MatrixXd inverse = H.completeOrthogonalDecomposition().pseudoInverse();
  EXPECT_LT((s.covariance - inverse).norm(), 1e-14);
  EXPECT_LT((s.covariance - s.cofactor_Q * H * s.cofactor_Q).norm(), 1e-14);
}

TEST(Datum, EstimateIsTheSolutionWithoutItsCovariance) {
  const Information data = Levelling().information();
  for (const Datum& datum : {first_point_is_zero(), mean_is_zero()}) {
    EXPECT_LT((*datum.estimate(data) - datum.solve(data)->U).norm(), 1e-15);
  }
  EXPECT_EQ(Datum(Eigen::MatrixXd(0, 4)).estimate(data).error().code, ErrorCode::RankDeficient);
}

TEST(Datum, SolutionDoesNotDependOnTheWeightOfTheConditions) {
  const Levelling net;
  const DatumSolution s = *mean_is_zero().solve(net.information());
  for (const double weight : {1e-4, 1e4}) {  // rounding: eps times the weight
    const DatumSolution other = *mean_is_zero().solve(net.information(), {.weight = weight});
    EXPECT_LT((other.U - s.U).norm(), 1e-11);
    EXPECT_LT((other.covariance - s.covariance).norm(), 1e-11);
  }
}

/// A condition on one unknown: exactly zero, without an uncertainty.
TEST(Datum, OfOneUnknownIsExact) {
  const DatumSolution s = *first_point_is_zero().solve(Levelling().information());
  EXPECT_EQ(s.U(0), 0.0);
  EXPECT_EQ(s.covariance.row(0).norm(), 0.0);
}

TEST(Datum, TransformsToAnotherDatum) {
  const Information data = Levelling().information();
  const DatumSolution from = *mean_is_zero().solve(data), to = *first_point_is_zero().solve(data);
  const Eigen::MatrixXd S = *first_point_is_zero().transformation(null_space(data).basis);
  EXPECT_LT((S * from.U - to.U).norm(), 1e-14);
  EXPECT_LT((S * from.covariance * S.transpose() - to.covariance).norm(), 1e-14);
  EXPECT_LT((S * S - S).norm(), 1e-14);
}

TEST(Datum, CountsOtherWeightsThanThoseOfTheNoise) {
  const Levelling net;
  const Eigen::VectorXd root_weight = (Eigen::VectorXd(5) << 1, 2, 1, 3, 1).finished();
  Information data(4), noise(4);
  data.add_rows(root_weight.asDiagonal() * net.A, root_weight.cwiseProduct(net.y));
  const Eigen::VectorXd weight = root_weight.cwiseAbs2();
  noise.add_rows(weight.asDiagonal() * net.A, Eigen::VectorXd::Zero(5));  // sigma = 1
  const DatumSolution s = *mean_is_zero().solve(data, {.noise = &noise});
  const Eigen::MatrixXd gain = s.cofactor_Q * net.A.transpose() * weight.asDiagonal();
  EXPECT_LT((s.covariance - gain * gain.transpose()).norm(), 1e-14);
}

TEST(Datum, NamesAnUnknownWithoutData) {
  Information data(5);
  data.add_rows((Eigen::MatrixXd(5, 5) << Levelling().A, Eigen::VectorXd::Zero(5)).finished(),
                Levelling().y);
  const auto s = Datum(Eigen::RowVectorXd::Ones(5)).solve(data, {.label = [](std::size_t i) {
                                                            return "point " + std::to_string(i);
                                                          }});
  ASSERT_FALSE(s);
  EXPECT_EQ(s.error().code, ErrorCode::RankDeficient);
  EXPECT_EQ(s.error().text, "adjustment: 1 parameters have no data, among them point 4");
}

TEST(Datum, RefusesMoreUndeterminedCombinationsThanConditions) {
  Information data(4);
  data.add_rows(Levelling().A.topRows(2).eval() + Eigen::MatrixXd::Constant(2, 4, 0.1),
                Eigen::Vector2d::Zero());
  const auto s = mean_is_zero().solve(data);
  ASSERT_FALSE(s);
  EXPECT_EQ(s.error().code, ErrorCode::RankDeficient);
}

/// Points 0 to 3 are levelled, and their common height is the datum; the difference of points 4 and
/// 5 is measured, their height is not.
TEST(Datum, NamesOnlyUnknownsThatNeitherDataNorConditionsDetermine) {
  const Levelling net;
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(6, 6);
  A.topLeftCorner(5, 4) = net.A;
  A.row(5) << 0, 0, 0, 0, 1, -1;
  Information data(6);
  data.add_rows(A, Eigen::VectorXd::Zero(6));
  Eigen::RowVectorXd mean_height(6);
  mean_height << 1, 1, 1, 1, 0, 0;
  for (const bool with_covariance : {true, false}) {
    const Datum datum{Eigen::MatrixXd(mean_height)};
    const std::string text =
        with_covariance ? datum.solve(data).error().text : datum.estimate(data).error().text;
    EXPECT_THAT(text, testing::HasSubstr("combinations of unknown 4, unknown 5"));
    EXPECT_THAT(text, testing::Not(testing::HasSubstr("unknown 3")));
  }
}

/// Columns 1 and 2 of three are the same except for 1e-7: rounding does not make them equal, a
/// measurement of them would.
TEST(Datum, CountsWeakCombinationsAsZeroBelowAStatedThreshold) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Random(20, 3);
  A.col(2) = A.col(1) + 1e-7 * A.col(2).eval();
  Information data(3);
  data.add_rows(A, Eigen::VectorXd::Ones(20));
  const Datum no_conditions(Eigen::MatrixXd(0, 3));
  EXPECT_TRUE(no_conditions.solve(data));
  for (const bool with_covariance : {true, false}) {
    const DatumOptions options{.zero = 1e-6};
    const std::string text = with_covariance ? no_conditions.solve(data, options).error().text
                                             : no_conditions.estimate(data, options).error().text;
    EXPECT_THAT(text, testing::HasSubstr("rank 2"));
    EXPECT_THAT(text, testing::HasSubstr("unknown 1"));
    EXPECT_THAT(text, testing::HasSubstr("unknown 2"));
    EXPECT_THAT(text, testing::Not(testing::AnyOf(testing::HasSubstr("unknown 0"),
                                                  testing::HasSubstr("datum"))));
  }
}

/// A condition that the data determine already does not fix the common height.
TEST(Datum, RefusesAConditionThatFixesNothing) {
  const Datum difference(Eigen::RowVector4d(1, -1, 0, 0));
  const Information data = Levelling().information();
  EXPECT_FALSE(difference.solve(data));
  const auto S = difference.transformation(null_space(data).basis);
  ASSERT_FALSE(S);
  EXPECT_EQ(S.error().code, ErrorCode::DegenerateGeometry);
}

MachineNodes three_node_axes() {
  return {*equidistant_nodes(-0.3, 0.3, 0.2), *equidistant_nodes(-0.25, 0.25, 0.25),
          *equidistant_nodes(-0.4, 0.1, 0.2)};
}

/// The reference of X lies between nodes: the condition has the weights of the interpolation.
TEST(DatumConditions, OfCubicTablesAreZeroAtTheReference) {
  const auto layout = ParameterLayout::observable_with_one_target({}, three_node_axes());
  const TableOptions cubic{
      .interpolation = {Interpolation::NaturalCubic, Interpolation::NaturalCubic,
                        Interpolation::NaturalCubic},
      .travel = TravelDependence::Backlash};
  const TableBasis basis = *TableBasis::of(*layout, cubic);
  const Eigen::MatrixXd K = datum_conditions(ModelDatum::G1, basis, basis.size() + 6);
  ASSERT_EQ(K.rows(), 20);
  ASSERT_EQ(K.cols(), static_cast<Eigen::Index>(basis.size() + 6));
  const NodeWeights weights = basis.interpolation(Axis::X).at(0.0);
  ASSERT_EQ(weights.count(), 4u);
  for (std::size_t i = 0; i < weights.count(); ++i) {
    EXPECT_EQ(K(0, static_cast<Eigen::Index>(i)), weights[i]);
  }
  EXPECT_EQ(K.rightCols(20).norm(), 0.0);  // backlash, rigid unknowns
}

}  // namespace

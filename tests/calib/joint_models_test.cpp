// Joint identification of models with covariances that are made here: effects that parts share,
// cubic tables, another tool.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "abbe/calib/internal/geometry/axis_scale_columns.hpp"
#include "abbe/calib/internal/joint/left_out_rotations.hpp"
#include "abbe/calib/internal/joint/pair_problem.hpp"
#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "abbe/calib/internal/statistics/chi2_tail.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "joint_parts.hpp"

namespace {
namespace joint = abbe::calib::joint;
using abbe::calib::Axis;
using abbe::calib::index;
using abbe::calib::Interpolation;
using abbe::calib::TableBasis;
using abbe::calib::TableOptions;
using abbe::calib::Vector3;
using abbe::calib::VolumetricModel;
using testing::HasSubstr;
using testing::SizeIs;

const Vector3 kModelTool_m(0.02, -0.015, -0.12);

/// Models of one machine: equal truth, independent noise of `u_m` per coordinate of the datum.
struct ModelsOfOneMachine {
  std::mt19937_64 random{7};  // before truth, which is drawn from it
  TableBasis basis;
  Eigen::MatrixXd N;
  Eigen::VectorXd truth;

  explicit ModelsOfOneMachine(Interpolation kind)
      : basis(*TableBasis::of(
            abbe::tests::otf::layout_of(abbe::tests::otf::coarse_machine("[w X' b Y Z (C1) t]")),
            TableOptions::all_axes(kind))),
        N(abbe::calib::datum_coordinates(basis).N),
        truth(N * draw(30e-6)) {}

  Eigen::VectorXd draw(double sigma) {
    std::normal_distribution<double> normal;
    return Eigen::VectorXd::NullaryExpr(N.cols(), [&] { return sigma * normal(random); });
  }
  [[nodiscard]] VolumetricModel with(const Eigen::VectorXd& U, const Eigen::MatrixXd& C,
                                     const Vector3& tool_m = kModelTool_m) const {
    return *VolumetricModel::from_vector(
        basis.layout(), abbe::calib::ModelDatum::G1, std::array{tool_m}, U,
        0.5 * (C + C.transpose()),
        *abbe::calib::ValidityVolume::hull_of(abbe::calib::tensor_grid(basis.layout().nodes())),
        basis.interpolation(Axis::X).kind());
  }
  /// G: effects that are contained in the covariance but are 0 here.
  VolumetricModel model(double u_m, const Eigen::MatrixXd& G) {
    return with(truth + N * draw(u_m), u_m * u_m * N * N.transpose() + G * G.transpose());
  }
  VolumetricModel model(double u_m) { return model(u_m, Eigen::MatrixXd(N.rows(), 0)); }
  [[nodiscard]] joint::CommonTables common() const { return {basis, kModelTool_m}; }
};

joint::JointModel joined(const std::vector<joint::Part>& parts, const joint::CommonTables& common) {
  const auto result = joint::identify(parts, common);
  EXPECT_TRUE(result) << (result ? "" : result.error().text);
  EXPECT_THAT(result->contradictions, testing::IsEmpty());
  return *result->joint;
}

TEST(JointModels, CubicTablesRemainCubic) {
  ModelsOfOneMachine m(Interpolation::NaturalCubic);
  const joint::JointModel result = joined({*joint::part_of_run("run 1", m.model(1e-9), m.common()),
                                           *joint::part_of_run("run 2", m.model(1e-9), m.common())},
                                          m.common());
  EXPECT_EQ(result.model.interpolation(), Interpolation::NaturalCubic);

  const Vector3 between(-0.21, 0.11, -0.07);
  const Vector3 V = m.basis.V_m({.q_m = between, .tool_offset_m = kModelTool_m},
                                {m.truth.data(), m.basis.size()});
  EXPECT_LT((result.model.V_at(between, kModelTool_m) - V).norm(), 20e-9);
}

/// One column for each of the scales of X, Y, Z, with the relative standard uncertainty u.
Eigen::MatrixXd scales(const ModelsOfOneMachine& m, double u) {
  return u * axis_scale_columns(m.basis.layout());
}

/// u of EXX at its first node, 0.3 m from the reference.
double u_of_first_EXX(const VolumetricModel& model) {
  const auto table = model.tables()->layout().find({abbe::calib::Motion::X, Axis::X});
  const auto at = static_cast<Eigen::Index>(table->offset);
  return std::sqrt(model.covariance()(at, at));
}

TEST(JointModels, ACommonScaleDoesNotAverageOut) {
  constexpr double kScale = 10e-6, kNoise = 0.1e-6;
  const joint::CommonEffects effects{.u_axis_scale = {kScale, kScale, kScale}};
  for (const std::size_t count : {2u, 3u}) {
    ModelsOfOneMachine m(Interpolation::Linear);
    std::vector<joint::Part> shared, independent;
    for (std::size_t k = 0; k < count; ++k) {
      const VolumetricModel model = m.model(kNoise, scales(m, kScale));
      const std::string name = "run " + std::to_string(k + 1);
      shared.push_back(*joint::part_of_run(name, model, m.common(), effects));
      independent.push_back(*joint::part_of_run(name, model, m.common()));
    }

    const joint::JointModel result = joined(shared, m.common());
    const double of_scale = kScale * 0.3;
    EXPECT_GT(u_of_first_EXX(result.model), of_scale);
    EXPECT_LT(u_of_first_EXX(joined(independent, m.common()).model),
              1.01 * of_scale / std::sqrt(static_cast<double>(count)));
    ASSERT_THAT(result.effects, SizeIs(3));
    EXPECT_EQ(result.effects.front().name, "scale of X");
    EXPECT_NEAR(result.effects.front().u, 1.0, 1e-6);  // no part determines it

    // Only the common error is in all parts: the rest averages as without it.
    const Eigen::MatrixXd G = scales(m, kScale);
    const Eigen::MatrixXd expected =
        kNoise * kNoise / static_cast<double>(count) * m.N * m.N.transpose() + G * G.transpose();
    EXPECT_LT((result.model.covariance() - expected).norm(), 1e-9 * expected.norm());
  }
}

TEST(JointModels, RefusesAnArrayWithoutBallErrors) {
  const ModelsOfOneMachine m(Interpolation::Linear);
  abbe::calib::evemu::Observations o;
  o.machine = {m.basis.layout().chain(), kModelTool_m};
  for (const double s_m : {0.0, 1e-6}) {
    const auto part = joint::part_of_array("array 2", o, m.common(), {.s_m = s_m});
    ASSERT_FALSE(part);
    EXPECT_EQ(part.error().code, abbe::calib::ErrorCode::TooFewObservations);
    EXPECT_EQ(part.error().text, "joint identification: array 2: there are no ball errors");
  }
}

TEST(JointModels, RefusesABallBeyondTheNodes) {
  const ModelsOfOneMachine m(Interpolation::Linear);
  abbe::calib::evemu::Observations o;
  o.machine = {m.basis.layout().chain(), kModelTool_m};
  for (int ball = 1; ball <= 4; ++ball) {
    o.rows.push_back({3, ball, Vector3(0.0, 0.1 * (ball - 1), -0.1 * (ball % 2)), Vector3::Zero()});
  }
  const auto part = joint::part_of_array("array", o, m.common(), {.s_m = 1e-6});
  ASSERT_FALSE(part);
  EXPECT_EQ(part.error().code, abbe::calib::ErrorCode::BadInput);
  EXPECT_THAT(part.error().text,
              HasSubstr("array: ball 4 at position 3 has the reading Y = 300 mm, the nodes of the "
                        "common tables reach from -250 to 250 mm"));
}

/// EYX differs at one node, so that p is about 0.02: a contradiction with a limit of 0.05 only.
TEST(JointModels, ExplanationsLeaveNoContradiction) {
  ModelsOfOneMachine m(Interpolation::Linear);
  const auto table = m.basis.layout().find({abbe::calib::Motion::Y, Axis::X});
  const auto first = static_cast<Eigen::Index>(table->offset);
  Eigen::VectorXd bump = Eigen::VectorXd::Zero(m.N.rows());
  bump(first + 1) = 1.0;  // EYX at -0.1 m
  const Eigen::MatrixXd C = 1e-12 * m.N * m.N.transpose();
  const auto one = joint::part_of_run("run 1", m.with(m.truth, C), m.common());
  const double u_m = std::sqrt(2.0) * 1e-6;
  const auto other = joint::part_of_run("run 2", m.with(m.truth + 7.0 * u_m * bump, C), m.common());

  const std::vector<joint::Part> parts{*one, *other};
  const auto usual = joint::test_pairs(parts, m.common());
  ASSERT_TRUE(usual);
  const double p = usual->front().all.p;
  ASSERT_GT(p, 1e-3);
  ASSERT_LT(p, 0.05);
  // A tenth of the false alarms is that of the pair.
  const auto strict = joint::test_pairs(parts, m.common(), {.false_alarm = 0.5});
  ASSERT_TRUE(strict);
  ASSERT_TRUE(strict->front().contradiction);
  ASSERT_THAT(strict->front().explanations, SizeIs(1));
  EXPECT_THAT(strict->front().explanations.front().text, HasSubstr("they differ in EYX"));
}

TEST(JointModels, AnEstimatedNoiseMayBeTooSmallByItsTwoPercentQuantile) {
  ModelsOfOneMachine m(Interpolation::Linear);
  std::vector<joint::Part> parts{*joint::part_of_run("run 1", m.model(1e-6), m.common()),
                                 *joint::part_of_run("run 2", m.model(1e-6), m.common())};
  const double stated = joint::test_pairs(parts, m.common())->front().all.statistic;
  for (const std::size_t dof : {20u, 50u, 200u}) {
    parts.back().dof_of_noise = static_cast<double>(dof);
    const double estimated = joint::test_pairs(parts, m.common())->front().all.statistic;
    const double chi_square = static_cast<double>(dof) * estimated / stated;
    EXPECT_NEAR(std::exp(abbe::calib::log_chi2_tail(chi_square, dof)), 0.98, 1e-3) << dof;
  }
}

/// The reference of X (0) is between nodes: the condition of cubic tables contains other nodes than
/// that of linear ones.
TEST(JointModels, LeftOutRotationsAreInTheDatumOfCubicTables) {
  const ModelsOfOneMachine m(Interpolation::NaturalCubic);
  const Eigen::MatrixXd K =
      abbe::calib::datum_conditions(abbe::calib::ModelDatum::G1, m.basis, m.basis.size());
  const auto effect =
      joint::LeftOutRotations(m.common(), Vector3(0.03, 0.02, -0.05)).of_parameters();
  ASSERT_TRUE(effect);
  EXPECT_GT(effect->norm(), 1e-3);
  EXPECT_LT((K * *effect).norm(), 1e-12 * effect->norm());
}

TEST(JointModels, RefusesACommonEffectOfTwoSizes) {
  ModelsOfOneMachine m(Interpolation::Linear);
  const VolumetricModel model = m.model(1e-6, scales(m, 10e-6));
  const std::vector<joint::Part> parts{
      *joint::part_of_run("run 1", model, m.common(), {.u_axis_scale = {1e-6, 0.0, 0.0}}),
      *joint::part_of_run("run 2", model, m.common(), {.u_axis_scale = {2e-6, 0.0, 0.0}})};
  const auto result = joint::identify(parts, m.common());
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, abbe::calib::ErrorCode::BadInput);
  EXPECT_THAT(result.error().text,
              HasSubstr("the uncertainty of 'scale of X' is 1e-06 in run 1, 2e-06 in run 2"));
}

/// Array 2 does not state an uncertainty of Ball2: the errors of the other balls must still be the
/// same unknowns as those of array 1.
TEST(JointModels, ErrorsOfTheArrayArePairedByBall) {
  const auto run = abbe::tests::otf::make_run({});
  const joint::CommonTables common{*TableBasis::of(abbe::tests::otf::layout_of(run.machine)),
                                   run.machine.target_offset_m};
  auto observed = abbe::tests::joint::observed_array(run, abbe::tests::joint::field_of(run),
                                                     {.tool_m = common.tool_offset_m});
  const auto one = joint::part_of_array("array 1", observed, common, {.s_m = 1e-6});
  observed.artefact->u_ball_m[1] = 0.0;
  const auto two = joint::part_of_array("array 2", observed, common, {.s_m = 1e-6});
  ASSERT_TRUE(one && two);
  ASSERT_THAT(one->effects, SizeIs(27));
  ASSERT_THAT(two->effects, SizeIs(24));
  EXPECT_EQ(one->effects[7], "y of ball 3 of array");
  EXPECT_EQ(two->effects[4], "y of ball 3 of array");
}

/// Both parts leave one combination of EXX undetermined; d is determined by the other one. The
/// difference and its uncertainty are those of the two rows that contain it.
TEST(JointModels, ADifferenceKeepsItsRowsWhereBothPartsAreIncomplete) {
  const ModelsOfOneMachine m(Interpolation::Linear);
  const abbe::calib::DatumCoordinates c = abbe::calib::datum_coordinates(m.basis);
  const auto& EXX = c.groups.front();
  ASSERT_EQ(EXX.name, "EXX");
  ASSERT_EQ(EXX.size, 3);
  const Eigen::VectorXd direction = Eigen::Vector3d(1.0, 1.0 / 3.0, 0.7).normalized();
  constexpr double kDifference_m = 5e-6, kU_m = 1e-6;
  const auto part = [&](const char* name, double value_m) {
    abbe::calib::estimation::Information information(m.basis.size());
    Eigen::VectorXd column = Eigen::VectorXd::Zero(c.N.cols());
    column.segment(EXX.first, EXX.size) = direction;
    information.add_rows((c.N * column).transpose() / kU_m,
                         Eigen::VectorXd::Constant(1, value_m / kU_m));
    return joint::Part{.name = name, .method = "test", .information = information};
  };

  const joint::Part one = part("one", 0.0), two = part("two", kDifference_m);
  const joint::PairProblem pair(one, two, c);
  Eigen::MatrixXd free = Eigen::MatrixXd::Zero(c.N.cols(), EXX.size);
  free.middleRows(EXX.first, EXX.size).setIdentity();
  const joint::PairProblem::Freed freed = pair.freed(free);
  EXPECT_EQ(freed.drop_dof, 1u);
  ASSERT_GE(freed.root_cov_d.cols(), 1);
  EXPECT_NEAR(direction.dot(freed.d), kDifference_m, 1e-9);
  EXPECT_NEAR((direction.transpose() * freed.root_cov_d).norm(), std::sqrt(2.0) * kU_m, 1e-9);
}

/// The scales of the machine are in the run and in the array.
TEST(JointModels, RunAndArrayShareTheScales) {
  constexpr double kScale = 10e-6;
  const auto run = abbe::tests::otf::make_run({.in_datum = true});
  ASSERT_EQ(run.machine.target_offset_m, kModelTool_m);
  ModelsOfOneMachine m(Interpolation::Linear);
  m.truth = run.truth;
  const joint::CommonEffects effects{.u_axis_scale = {kScale, kScale, kScale}};
  const auto array =
      joint::part_of_array("array",
                           abbe::tests::joint::observed_array(
                               run, abbe::tests::joint::field_of(run), {.tool_m = kModelTool_m}),
                           m.common(), {.s_m = 1e-6, .effects = effects});
  ASSERT_TRUE(array) << array.error().text;
  ASSERT_EQ(array->effects.front(), "scale of X");

  const auto of_run =
      joint::part_of_run("run", m.model(0.1e-6, scales(m, kScale)), m.common(), effects);
  const joint::JointModel result = joined({*of_run, *array}, m.common());
  EXPECT_GT(u_of_first_EXX(result.model), kScale * 0.3);
  EXPECT_THAT(result.effects, SizeIs(3 + 27));
}

TEST(JointModels, RefusesEffectsThatTheCovarianceDoesNotContain) {
  ModelsOfOneMachine m(Interpolation::Linear);
  const VolumetricModel model = m.model(0.1e-6, scales(m, 10e-6));
  const auto part = joint::part_of_run("run 1", model, m.common(),
                                       {.u_ranges = 5e-6, .u_axis_scale = {10e-6, 20e-6, 10e-6}});
  ASSERT_FALSE(part);
  EXPECT_EQ(part.error().code, abbe::calib::ErrorCode::NotApplicable);
  EXPECT_THAT(part.error().text, HasSubstr("the covariance of run 1 is not larger than the effects "
                                           "stated as common (ranges of tracker, scale of X"));
}

}  // namespace

/// Errors that the tables of a run on the fly cannot represent: they are found where they repeat at
/// a place, and are in the uncertainty of V.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "abbe/calib/joint/identify.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/model/model_update.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/judge/judge.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using ::testing::Contains;
using ::testing::HasSubstr;

using MoreError = std::function<Vector3(const Vector3& q_m)>;

Vector3 waves_of_X(const Vector3& q_m) {
  constexpr double kWave_m = 5e-6, kPeriod_m = 0.1;
  return kWave_m * std::sin(2.0 * M_PI * q_m.x() / kPeriod_m) * Vector3(0.0, 1.0, 0.0);
}
Vector3 step_of_Y(const Vector3& q_m) {
  constexpr double kStepOfY_m = 20e-6, kPlaceOfStep_m = -0.13;
  return (q_m.y() > kPlaceOfStep_m ? kStepOfY_m : 0.0) * Vector3(1.0, 0.0, 0.0);
}
/// Along Y, where no table contains a product of X and Y.
Vector3 tilt_of_X_and_Y(const Vector3& q_m) {
  return 300e-6 * q_m.x() * q_m.y() * Vector3(0.0, 1.0, 0.0);
}
Vector3 no_error(const Vector3&) {
  return Vector3::Zero();
}

MadeRun run_with_error(const MoreError& error, unsigned seed = 1) {
  // In datum: rotations of the tables by 200 urad would be strains, which repeat, too.
  MadeRun run = make_run({.seed = seed, .noise_seed = seed, .in_datum = true});
  const RigidTransform& T = run.T_machine_tracker;
  for (TrackerObservation& sample : run.samples) {
    const Vector3 q_m = T * sample.p_tracker_m - run.machine.target_offset_m;
    sample.p_tracker_m += T.R.transpose() * error(q_m);
  }
  run.options.estimator = Estimator::Simultaneous;
  return run;
}

Identification identified_with(const MadeRun& run) {
  return *identify(run.samples, run.machine, run.path, run.noise, run.options);
}

/// Share of places at which what is left, without rigid motion, is at most U(V).
double share_below_U(const MadeRun& run, const VolumetricModel& model, const MoreError& error) {
  std::mt19937_64 random(1);
  std::vector<Vector3> points_m, left_m;
  std::vector<double> U_m;
  const ParameterLayout layout = layout_of(run.machine);
  for (int i = 0; i < 500; ++i) {
    Vector3 q_m;
    for (Eigen::Index a = 0; a < 3; ++a) {
      const std::vector<double>& nodes_m = run.machine.nodes[static_cast<std::size_t>(a)].nodes_m;
      q_m(a) = std::uniform_real_distribution(nodes_m.front(), nodes_m.back())(random);
    }
    const VolumetricError e = model.error_at(q_m, run.machine.target_offset_m);
    const Vector3 true_V_m = volumetric_error(layout, {run.truth.data(), layout.model_size()}, q_m,
                                              run.machine.target_offset_m) +
                             error(q_m);
    points_m.push_back(q_m + run.machine.target_offset_m);
    left_m.push_back(e.V_m - true_V_m);
    U_m.push_back(2.0 * std::sqrt(e.cov_V_m2.trace()));
  }
  const ModelDifference difference = *rigid_free(points_m, left_m);
  int below = 0;
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    const Vector3 motion_m =
        difference.rigid.head<3>() + rotation_effect(points_m[i]) * difference.rigid.tail<3>();
    below += (left_m[i] - motion_m).norm() <= U_m[i] ? 1 : 0;
  }
  return below / 500.0;
}

double u_at_nodes_m(const VolumetricModel& model, ErrorMotion motion, std::size_t node) {
  const std::size_t offset = model.tables()->layout().find(motion)->offset;
  return model.misfit()->u_of_parameters(static_cast<Eigen::Index>(offset + node));
}

TEST(OtfMisfit, NoneInSoundRuns) {
  for (const unsigned seed : {1U, 2U, 3U, 4U, 5U, 6U}) {
    const Identification id = identified_with(run_with_error(no_error, seed));
    EXPECT_EQ(id.solution.model.misfit(), nullptr) << seed;
  }
}

TEST(OtfMisfit, WavesShorterThanTheNodeDistanceAreInU) {
  const MadeRun run = run_with_error(waves_of_X);
  const Identification id = identified_with(run);
  const VolumetricModel& model = id.solution.model;
  ASSERT_NE(model.misfit(), nullptr);
  const double u_m = u_at_nodes_m(model, {Motion::Y, Axis::X}, 1);
  EXPECT_GT(u_m, 2e-6);  // 5 um / sqrt(2) = 3.5 um
  EXPECT_LT(u_m, 6e-6);
  EXPECT_LT(u_at_nodes_m(model, {Motion::Z, Axis::X}, 1), 1e-6);
  EXPECT_GE(share_below_U(run, model, waves_of_X), 0.93);
  EXPECT_THAT(id.observations.notes,
              Contains(AllOf(HasSubstr("between the nodes of X"), HasSubstr("EYX"))));
}

TEST(OtfMisfit, AStepIsFoundInItsCell) {
  const MadeRun run = run_with_error(step_of_Y);
  const Identification id = identified_with(run);
  const VolumetricModel& model = id.solution.model;
  ASSERT_NE(model.misfit(), nullptr);
  const ErrorMotion EXY{Motion::X, Axis::Y};
  EXPECT_GT(u_at_nodes_m(model, EXY, 0), 3.0 * u_at_nodes_m(model, EXY, 2));
  // A sawtooth in one of two cells, which also turns the other.
  EXPECT_GE(share_below_U(run, model, step_of_Y), 0.9);
}

TEST(OtfMisfit, ErrorsOfTwoAxesAreInU) {
  const MadeRun run = run_with_error(tilt_of_X_and_Y);
  const Identification id = identified_with(run);
  const VolumetricModel& model = id.solution.model;
  ASSERT_NE(model.misfit(), nullptr);
  EXPECT_GE(share_below_U(run, model, tilt_of_X_and_Y), 0.93);
}

TEST(OtfMisfit, IsKeptByDescriptionAndReadBack) {
  const Identification id = identified_with(run_with_error(waves_of_X));
  const VolumetricModel& model = id.solution.model;
  const auto read = VolumetricModel::from_description(model.description());
  ASSERT_TRUE(read) << read.error().text;
  ASSERT_NE(read->misfit(), nullptr);
  const Vector3 q_m(0.02, 0.1, -0.3);
  EXPECT_EQ(read->error_at(q_m, model.tool_offsets_m().front()).cov_V_m2,
            model.error_at(q_m, model.tool_offsets_m().front()).cov_V_m2);
}

/// Neither a later run that does not show it nor another part removes a misfit.
TEST(OtfMisfit, IsKeptByUpdatesAndJointModels) {
  const VolumetricModel with = identified_with(run_with_error(waves_of_X)).solution.model;
  const VolumetricModel without = identified_with(run_with_error(no_error)).solution.model;
  const auto updated = update_model(with, without, {});
  ASSERT_TRUE(updated) << updated.error().text;
  ASSERT_NE(updated->misfit(), nullptr);
  EXPECT_EQ(updated->misfit()->u_of_parameters, with.misfit()->u_of_parameters);

  const joint::CommonTables common = *joint::tables_of(with);
  const std::vector parts{*joint::part_of_run("run 1", with, common),
                          *joint::part_of_run("run 2", without, common)};
  const auto both = joint::joint_model(parts, common);
  ASSERT_TRUE(both) << both.error().text;
  ASSERT_NE(both->model.misfit(), nullptr);
  EXPECT_EQ(both->model.misfit()->u_of_parameters, with.misfit()->u_of_parameters);
}

TEST(Misfit, WrongSizesAndValuesAreRefused) {
  const VolumetricModel model = identified_with(run_with_error(no_error)).solution.model;
  EXPECT_THAT(model.with_misfit({.u_of_parameters = Eigen::VectorXd::Ones(3)}).error().text,
              HasSubstr("misfit of 3 parameters"));
  EXPECT_THAT(model.with_misfit({.u_V_m = Vector3(-1e-6, 0, 0)}).error().text,
              HasSubstr("negative"));
  EXPECT_THAT(model.with_misfit({.u_V_m = Vector3(NAN, 0, 0)}).error().text,
              HasSubstr("not a number"));
  EXPECT_EQ(model.with_misfit({})->misfit(), nullptr);
}

}  // namespace

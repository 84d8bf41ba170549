/// Directly measured tables as a model, compared in the volume.

#include "abbe/calib/direct/volume.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "direct_measurement.hpp"
#include "joint_parts.hpp"

namespace abbe::calib::direct {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using tests::direct::all_measured;

class DirectVolume : public ::testing::Test {
 protected:
  /// Squareness of the truth, in three runs.
  void add_squareness(std::vector<MeasuredError>& errors) const {
    const auto layout = tests::otf::layout_of(run_.machine);
    for (std::size_t i = 0; i < 3; ++i) {
      const double value = run_.truth(static_cast<Eigen::Index>(layout.squareness_offset() + i));
      MeasuredError error{.name = std::string(kSquarenessNames[i]), .readings = {}};
      for (int r = 1; r <= 3; ++r) {
        error.readings.push_back({0.0, value + 0.1e-6 * (r - 2), r, true});
      }
      errors.push_back(error);
    }
  }

  /// Identified once: it takes seconds.
  static const tests::otf::MadeRun& machine() {
    static const auto run = tests::otf::make_run({.in_gauge = true});
    return run;
  }
  static const VolumetricModel& identified() {
    static const VolumetricModel model = tests::joint::model_of(machine());
    return model;
  }

  const tests::otf::MadeRun& run_ = machine();
  const VolumetricModel& model_ = identified();
};

TEST_F(DirectVolume, AgreesWithinTheUncertaintyOfBoth) {
  const VolumeComparison c = *compare_in_volume(all_measured(run_), model_);
  EXPECT_EQ(c.compared.size(), 14u);
  EXPECT_THAT(c.not_measured, ElementsAre("EA0Z", "EB0Z", "EC0Y"));
  ASSERT_TRUE(c.u_rms_m);
  EXPECT_LT(c.difference.as_stated.rms_m, 2.0 * *c.u_rms_m);
  EXPECT_LT(c.difference.rigid_free.rms_m, 0.1 * c.V_model.rms_m);
  EXPECT_NEAR(c.V_measured.mean_m / c.V_model.mean_m, 1.0, 0.1);
}

/// With squareness the measured model is the whole machine: its V is that of the truth.
TEST_F(DirectVolume, OfAllErrorsIsTheMachine) {
  auto errors = all_measured(run_, {.noise = 0.0, .offset = 0.0, .slope = 0.0});
  for (auto& error : errors) {  // a copy is refused
    std::erase_if(error.readings, [](const Reading& r) { return r.run > 1; });
  }
  add_squareness(errors);
  const VolumeComparison c = *compare_in_volume(errors, model_, {.u_m = 1e-9, .u_rad = 1e-9});
  EXPECT_THAT(c.not_measured, ::testing::IsEmpty());
  const auto layout = tests::otf::layout_of(run_.machine);
  const Vector3& t = run_.machine.target_offset_m;
  for (const Vector3& q : tensor_grid(run_.machine.nodes)) {
    const Vector3 truth = volumetric_error(layout, {run_.truth.data(), layout.model_size()}, q, t);
    EXPECT_LT((c.measured.V_at(q, t) - truth).norm(), 1e-10);
  }
}

TEST_F(DirectVolume, ShowsAChangedTable) {
  auto errors = all_measured(run_);
  for (Reading& r : errors[1].readings) {  // EYX: a bow of 40 um
    r.value += 40e-6 * (1.0 - r.position_m * r.position_m / 0.09);
  }
  const VolumeComparison c = *compare_in_volume(errors, model_);
  EXPECT_GT(c.difference.as_stated.rms_m, 5.0 * *c.u_rms_m);
  EXPECT_NEAR(c.difference.as_stated.max_m, 40e-6, 3e-6);
}

TEST_F(DirectVolume, ConvertsFromTheMeasuredLine) {
  const Vector3 line(0.1, 0.1, -0.3), t = run_.machine.target_offset_m;
  auto errors = all_measured(run_);
  for (MeasuredError& error : errors) {
    const ErrorMotion motion = *error_motion(error.name);
    error.line_m = line;
    const Vector3 l = lever(run_.machine.chain, motion.axis, line, t);
    for (Reading& r : error.readings) {
      Vector3 rotation = Vector3::Zero();
      for (const Motion m : {Motion::A, Motion::B, Motion::C}) {
        if (tests::otf::layout_of(run_.machine).find({m, motion.axis})) {
          rotation(static_cast<Eigen::Index>(direction(m))) =
              tests::direct::table_value(run_, {m, motion.axis}, r.position_m);
        }
      }
      if (!is_rotation(motion.motion)) {
        r.value += rotation.cross(l)(static_cast<Eigen::Index>(direction(motion.motion)));
      }
    }
  }
  const VolumeComparison c = *compare_in_volume(errors, model_);
  EXPECT_LT(c.difference.as_stated.rms_m, 2.0 * *c.u_rms_m);
}

TEST_F(DirectVolume, StatesNoUncertaintyForOneRun) {
  const auto errors = all_measured(run_, {.runs = 1});
  EXPECT_FALSE(compare_in_volume(errors, model_)->u_rms_m);
  EXPECT_TRUE(compare_in_volume(errors, model_, {.u_m = 1e-6, .u_rad = 1e-6})->u_rms_m);
}

TEST_F(DirectVolume, LeavesOutWhatWasNotMeasured) {
  auto errors = all_measured(run_);
  errors.resize(6);  // the axis X
  const VolumeComparison c = *compare_in_volume(errors, model_);
  EXPECT_EQ(c.compared.size(), 6u);
  EXPECT_THAT(c.not_measured, Contains("EYY"));
  EXPECT_LT(c.difference.as_stated.rms_m, 2.0 * *c.u_rms_m);
}

TEST_F(DirectVolume, RefusesErrorsThatTheModelDoesNotHave) {
  MeasuredError roll = all_measured(run_).front();
  roll.name = "ECZ";
  const auto c = compare_in_volume(std::vector{roll}, model_);
  ASSERT_FALSE(c);
  EXPECT_EQ(c.error().code, ErrorCode::TooFewObservations);
}

}  // namespace
}  // namespace abbe::calib::direct

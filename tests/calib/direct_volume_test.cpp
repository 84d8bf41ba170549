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
  DirectVolume()
      : run_(tests::otf::make_run({.in_datum = true})), model_(tests::joint::model_of(run_)) {}

  void add_squareness(std::vector<MeasuredError>& errors, const Vector3& at) const {
    Vector3 first, last;
    for (std::size_t a = 0; a < 3; ++a) {
      first(static_cast<Eigen::Index>(a)) = run_.machine.nodes[a].nodes_m.front();
      last(static_cast<Eigen::Index>(a)) = run_.machine.nodes[a].nodes_m.back();
    }
    for (const std::string_view name : kSquarenessNames) {
      errors.push_back(
          tests::direct::measured_squareness(run_, std::string(name), at, first, last));
    }
  }

  /// One run without noise.
  std::vector<MeasuredError> exact() const {
    auto errors = all_measured(run_, {.noise = 0.0, .offset = 0.0, .slope = 0.0});
    for (auto& error : errors) {  // a copy is refused
      std::erase_if(error.readings, [](const Reading& r) { return r.run > 1; });
    }
    return errors;
  }

  tests::otf::MadeRun run_;
  VolumetricModel model_;
};

TEST_F(DirectVolume, AgreesWithinTheUncertaintyOfBoth) {
  const VolumeComparison c = *compare_in_volume(all_measured(run_), model_);
  EXPECT_EQ(c.compared.size(), 14u);
  EXPECT_THAT(c.not_measured, ElementsAre("EA0Z", "EB0Z", "EC0Y"));
  ASSERT_TRUE(c.u_rms_m);
  EXPECT_LT(c.difference.as_stated.rms_m, 2.0 * *c.u_rms_m);
  EXPECT_GT(c.difference.as_stated.rms_m, 0.3 * *c.u_rms_m) << "u is too large";
  EXPECT_LT(c.difference.rigid_free.rms_m, 0.1 * c.V_model.rms_m);
  EXPECT_NEAR(c.V_measured.mean_m / c.V_model.mean_m, 1.0, 0.1);
}

/// With squareness, wherever it was measured, the measured model is the whole machine: its V is
/// that of the truth.
TEST_F(DirectVolume, OfAllErrorsIsTheMachine) {
  for (const Vector3& at : {Vector3(0.1, -0.2, -0.3), Vector3(-0.2, 0.1, -0.1)}) {
    auto errors = exact();
    add_squareness(errors, at);
    const VolumeComparison c = *compare_in_volume(errors, model_, {.u_m = 1e-9, .u_rad = 1e-9});
    EXPECT_THAT(c.not_measured, ::testing::IsEmpty());
    const auto layout = tests::otf::layout_of(run_.machine);
    const Vector3& t = run_.machine.target_offset_m;
    for (const Vector3& q : tensor_grid(run_.machine.nodes)) {
      const Vector3 truth =
          volumetric_error(layout, {run_.truth.data(), layout.model_size()}, q, t);
      EXPECT_LT((c.measured.V_at(q, t) - truth).norm(), 1e-10);
    }
  }
}

/// The common range of X is from -0.15 to 0.2 m; EYX has one position in it, EZX none but its ends.
TEST_F(DirectVolume, TakesRangesThatDifferAtBothEnds) {
  const Vector3 at(0.1, -0.2, -0.3);
  auto errors = exact();
  for (MeasuredError& error : errors) {
    const ErrorMotion motion = *error_motion(error.name);
    if (motion.axis == Axis::X) {
      std::erase_if(error.readings, [&](const Reading& r) {
        const double p = r.position_m;
        return motion.motion == Motion::X   ? p > 0.21
               : motion.motion == Motion::A ? p < -0.16
               : motion.motion == Motion::Y ? p > -0.29 && p < 0.29 && std::abs(p) > 0.01
               : motion.motion == Motion::Z ? p > -0.21 && p < 0.29
                                            : false;
      });
    }
    if (!is_rotation(motion.motion)) {
      error.line_m = at;
      for (Reading& r : error.readings) {
        r.value = tests::direct::V_on_line(run_, motion, at, r.position_m);
      }
    }
  }
  add_squareness(errors, at);
  const auto c = compare_in_volume(errors, model_, {.u_m = 1e-9, .u_rad = 1e-9});
  ASSERT_TRUE(c) << c.error().text;
  EXPECT_EQ(c->compared.size(), 17u);
  const Vector3& t = run_.machine.target_offset_m;
  const Vector3 left(-0.15, at.y(), at.z()), right(0.2, at.y(), at.z());
  const Vector3 down(at.x(), -0.3, at.z()), up(at.x(), 0.3, at.z());
  const auto angle = [&](const VolumetricModel& m) {
    return -(m.V_at(right, t) - m.V_at(left, t)).y() / 0.35 -
           (m.V_at(up, t) - m.V_at(down, t)).x() / 0.6;
  };
  EXPECT_NEAR(angle(c->model), angle(model_), 1e-12);
  EXPECT_TRUE(std::isfinite(c->difference.rigid_free.rms_m));
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

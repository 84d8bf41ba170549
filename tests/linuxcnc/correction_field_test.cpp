// SPDX-License-Identifier: GPL-2.0-or-later
// The correction that the feeder for LinuxCNC computes from a received grid (linuxcnc/feeder).
#include "correction_field.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/model/volumetric_model.hpp"
#include "allocation_count.hpp"

namespace {

using abbe::daemon::ErrorLattice;
using abbe::daemon::LatticeNode;
using abbe::linuxcnc::command_correction;
using abbe::linuxcnc::FeedOptions;
using abbe::linuxcnc::Usable;
using Eigen::Vector3d;

constexpr double kNode_m = 0.1;

/// V of the grid: linear, so that the interpolation is exact.
Vector3d V_at(const Vector3d& q_m) {
  return {2e-5 + 1e-4 * q_m.x() - 2e-4 * q_m.y(), -3e-5 + 1e-4 * q_m.z(), 1e-4 * q_m.x()};
}

/// 3 x 3 x 3 nodes from 0 to 0.2 m; the node at the largest coordinates is outside the volume.
ErrorLattice grid() {
  std::vector<LatticeNode> nodes;
  for (int i = 0; i < 27; ++i) {
    const Vector3d p_m = kNode_m * Vector3d(i / 9, i / 3 % 3, i % 3);
    nodes.push_back({p_m, V_at(p_m), i != 26});
  }
  return ErrorLattice::create(nodes).value();
}

const Vector3d kPlace_m(0.03, 0.12, 0.07);
const Vector3d kModelTool_m(0.02, -0.015, -0.12);

Usable usable() {
  return {grid(), {}, "m", kModelTool_m};
}

/// LinuxCNC at a place, with the tool of the model: its offset has the opposite sign.
abbe_control control(const Vector3d& place_m = kPlace_m) {
  abbe_control c{};
  for (int i = 0; i < 3; ++i) {
    c.position[i] = 1e3 * place_m[i];
    c.tool_offset[i] = -1e3 * kModelTool_m[i];
  }
  c.tool_number = 1;
  c.homed = 1;
  return c;
}

abbe_control with_tool(int number, double z_mm) {
  abbe_control c = control();
  c.tool_number = number;
  c.tool_offset[2] = z_mm;
  return c;
}

abbe_wanted wanted_of(const abbe_control& c, const FeedOptions& options = {}) {
  return abbe::linuxcnc::wanted(usable(), 0.02, c, options);
}

TEST(CommandCorrection, TheToolIsAtTheCommandedPosition) {
  const auto c_m = command_correction(grid(), kPlace_m);
  ASSERT_TRUE(c_m);
  const Vector3d reading_m = kPlace_m + *c_m;
  EXPECT_LT((reading_m + V_at(reading_m) - kPlace_m).norm(), 1e-12);
}

TEST(CommandCorrection, NothingOutsideTheVolume) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Vector3d& p_m : {Vector3d(-0.01, 0.1, 0.1), Vector3d(0.1, 0.1, 0.21),
                              Vector3d(0.15, 0.15, 0.15), Vector3d(nan, 0.1, 0.1)}) {
    EXPECT_FALSE(command_correction(grid(), p_m)) << p_m.transpose();
  }
}

TEST(Wanted, IsTheCorrectionIfEverythingIsRight) {
  const auto w = wanted_of(control());
  EXPECT_TRUE(w.valid) << w.reason;
  const Vector3d c_m = *command_correction(grid(), kPlace_m);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(w.correction[i], 1e3 * c_m[i], 1e-12);
}

TEST(Wanted, HasTheTolerancesOfAbbe) {
  EXPECT_EQ(abbe::linuxcnc::kToolTolerance_m, abbe::calib::VolumetricModel::kToolTolerance_m);
}

TEST(Wanted, FollowsTheToolInTheSpindle) {
  EXPECT_TRUE(wanted_of(with_tool(2, 120.4)).valid) << "the tolerance of tool_ok, 0.5 mm";
  const auto longer = wanted_of(with_tool(2, 150.0));
  EXPECT_FALSE(longer.valid);
  EXPECT_STREQ(longer.reason,
               "the model is for the tool offset (20.000, -15.000, -120.000) mm, T2 has "
               "(20.000, -15.000, -150.000) mm");

  FeedOptions master;  // the control measures tools against one that is 30 mm long
  master.tool_offset_at_zero_m = {0.0, 0.0, -0.03};
  EXPECT_FALSE(wanted_of(with_tool(1, 120.0), master).valid);
  EXPECT_TRUE(wanted_of(with_tool(1, 90.0), master).valid);
}

TEST(Wanted, EveryRefusalHasAReasonAndIsZero) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  FeedOptions narrow, unusable;
  narrow.clamp_m = 1e-6;
  unusable.clamp_m = nan;
  abbe_control not_homed = control(), not_linked = control(), missing = control();
  not_homed.homed = 0;
  not_linked.tool = ABBE_TOOL_NOT_LINKED;
  missing.tool = ABBE_TOOL_OFFSET_MISSING;
  const Usable drift{std::nullopt, "ModelState is DRIFT", {}, {}};
  const std::vector<std::pair<abbe_wanted, std::string>> refusals{
      {wanted_of(not_homed), "not all joints are homed"},
      {abbe::linuxcnc::wanted(usable(), 0.3, control(), {}),
       "the DDS subscription does not answer"},
      {abbe::linuxcnc::wanted(drift, 0.02, control(), {}), drift.reason},
      {wanted_of(not_linked),
       "abbe-correction.tool-offset.x, y, z and tool-number are not all linked in HAL"},
      {wanted_of(missing),
       "the offset of T1 is not applied yet: G43 (after G49, if it equals that before)"},
      {wanted_of(with_tool(3, nan)),
       "the model is for the tool offset (20.000, -15.000, -120.000) mm, T3 has "
       "(20.000, -15.000, nan) mm"},
      {wanted_of(control(Vector3d(0.5, 0.0, 0.0))), "outside the volume of the model"},
      {wanted_of(control(), narrow), "the correction is larger than the clamp"},
      {wanted_of(control(), unusable), "the correction is larger than the clamp"}};
  for (const auto& [refusal, reason] : refusals) {
    EXPECT_FALSE(refusal.valid);
    EXPECT_EQ(refusal.reason, reason);
    for (const double c : refusal.correction) EXPECT_EQ(c, 0.0);
  }
}

/// The loop of the feeder has a realtime priority.
TEST(Wanted, ARefusalOfTheToolDoesNotAllocate) {
  const Usable with_model = usable();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double z_mm : {150.0, 1.0 / 3.0, 1e22, 1e300, nan}) {
    const abbe_control c = with_tool(2, z_mm);
    const abbe::tests::AllocationCount allocations;
    const auto refused = abbe::linuxcnc::wanted(with_model, 0.02, c, {});
    EXPECT_EQ(allocations.value(), 0u) << z_mm;
    EXPECT_FALSE(refused.valid);
  }
}

TEST(Wanted, ALongReasonIsCut) {
  const Usable refused{std::nullopt, std::string(5000, 'r'), {}, {}};
  const auto w = abbe::linuxcnc::wanted(refused, 0.02, control(), {});
  EXPECT_EQ(std::string(w.reason), std::string(ABBE_REASON_SIZE - 1, 'r'));
}

}  // namespace

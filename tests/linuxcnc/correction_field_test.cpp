// SPDX-License-Identifier: GPL-2.0-or-later
// The correction that the feeder for LinuxCNC computes from a received grid (linuxcnc/feeder).
#include "correction_field.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace {

using abbe::calib::ErrorLattice;
using abbe::calib::LatticeNode;
using abbe::calib::Vector3;
using abbe::linuxcnc::command_correction;
using abbe::linuxcnc::FeedLimits;
using abbe::linuxcnc::Usable;

constexpr double kNode_m = 0.1;

/// V of the grid: linear, so that the interpolation is exact.
Vector3 V_at(const Vector3& q_m) {
  return {2e-5 + 1e-4 * q_m.x() - 2e-4 * q_m.y(), -3e-5 + 1e-4 * q_m.z(), 1e-4 * q_m.x()};
}

/// 3 x 3 x 3 nodes from 0 to 0.2 m; the node at the largest coordinates is outside the volume.
ErrorLattice grid() {
  std::vector<LatticeNode> nodes;
  for (int i = 0; i < 27; ++i) {
    const Vector3 p_m = kNode_m * Vector3(i / 9, i / 3 % 3, i % 3);
    nodes.push_back({p_m, V_at(p_m), i != 26});
  }
  return ErrorLattice::create(nodes).value();
}

Usable usable() {
  return {grid(), {}, "m"};
}

const Vector3 kPlace_m(0.03, 0.12, 0.07);

TEST(CommandCorrection, TheToolIsAtTheCommandedPosition) {
  const auto c_m = command_correction(grid(), kPlace_m);
  ASSERT_TRUE(c_m);
  const Vector3 reading_m = kPlace_m + *c_m;
  EXPECT_LT((reading_m + V_at(reading_m) - kPlace_m).norm(), 1e-12);
}

TEST(CommandCorrection, NothingOutsideTheVolume) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Vector3& p_m : {Vector3(-0.01, 0.1, 0.1), Vector3(0.1, 0.1, 0.21),
                             Vector3(0.15, 0.15, 0.15), Vector3(nan, 0.1, 0.1)}) {
    EXPECT_FALSE(command_correction(grid(), p_m)) << p_m.transpose();
  }
}

TEST(Wanted, IsTheCorrectionIfEverythingIsRight) {
  const auto w = abbe::linuxcnc::wanted(usable(), 0.02, true, kPlace_m, {});
  EXPECT_TRUE(w.valid) << w.reason;
  EXPECT_EQ(w.correction_m, *command_correction(grid(), kPlace_m));
}

TEST(Wanted, EveryRefusalHasAReasonAndIsZero) {
  FeedLimits narrow;
  narrow.clamp_m = 1e-6;
  FeedLimits unusable;
  unusable.clamp_m = std::numeric_limits<double>::quiet_NaN();
  const Usable drift{std::nullopt, "ModelState is DRIFT", {}};
  const Vector3 outside_m(0.5, 0.0, 0.0);
  const std::vector<std::pair<abbe::linuxcnc::Wanted, std::string>> refusals{
      {abbe::linuxcnc::wanted(usable(), 0.02, false, kPlace_m, {}), "not all joints are homed"},
      {abbe::linuxcnc::wanted(usable(), 0.3, true, kPlace_m, {}),
       "the DDS subscription does not answer"},
      {abbe::linuxcnc::wanted(drift, 0.02, true, kPlace_m, {}), drift.reason},
      {abbe::linuxcnc::wanted(usable(), 0.02, true, outside_m, {}),
       "outside the volume of the model"},
      {abbe::linuxcnc::wanted(usable(), 0.02, true, kPlace_m, narrow),
       "the correction is larger than the clamp"},
      {abbe::linuxcnc::wanted(usable(), 0.02, true, kPlace_m, unusable),
       "the correction is larger than the clamp"}};
  for (const auto& [refusal, reason] : refusals) {
    EXPECT_FALSE(refusal.valid);
    EXPECT_EQ(refusal.reason, reason);
    EXPECT_EQ(refusal.correction_m, Vector3::Zero());
  }
}

}  // namespace

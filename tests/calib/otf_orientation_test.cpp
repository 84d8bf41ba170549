/// What decides how a path file lies in the machine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "abbe/calib/otf/identify.hpp"
#include "abbe/calib/otf/judge.hpp"
#include "abbe/calib/otf/orientation.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

MachineNodes travels(double from_z_m, double to_z_m) {
  return {*equidistant_nodes(-0.3, 0.3, 0.1), *equidistant_nodes(-0.25, 0.25, 0.1),
          *equidistant_nodes(from_z_m, to_z_m, 0.1)};
}

const Path kPath{{{-0.3, -0.25, 0.0}, {0.3, 0.2, 0.1}, {0.1, 0.25, -0.1}, {-0.2, 0.1, 0.1}}};

const Vector3 kTarget_m(0.0, 0.3, -0.4);

/// A levelled tracker 2 m beside the machine.
const RigidTransform kTracker{Matrix3::Identity(), {2.0, 1.0, -0.5}};

Verdict verdict_with(const OrientationEvidence& evidence, const RigidTransform& T = kTracker) {
  Verdict verdict;
  require_orientation(verdict, kPath, travels(-0.1, 0.1), kTarget_m, T, evidence);
  return verdict;
}

/// What the alignment gives with X and Y reversed in the path file: the target moves by turn q + offset.
RigidTransform about_z(RigidTransform T) {
  const Matrix3 turn = Vector3(-1, -1, 1).asDiagonal();
  return {turn * T.R, turn * (T.t_m - kTarget_m) + kTarget_m};
}

TEST(PathOrientation, HalfTurnsThatStayInTheTravelArePossible) {
  EXPECT_THAT(possible_half_turns(kPath, travels(-0.1, 0.1)), ElementsAre(Axis::X, Axis::Y, Axis::Z));
}

TEST(PathOrientation, ATravelOnOneSideOfZeroShowsReversedSigns) {
  Path path = kPath;
  for (Vector3& q : path.vertices_m) q.z() -= 0.2;
  EXPECT_THAT(possible_half_turns(path, travels(-0.4, 0.0)), ElementsAre(Axis::Z));
}

TEST(PathOrientation, WithoutEvidenceTheModelIsRefusedAndWhatHelpsIsNamed) {
  EXPECT_THAT(verdict_with({}).reasons,
              ElementsAre(AllOf(HasSubstr("turned by 180 degrees about X, Y or Z"),
                                HasSubstr("tracker.vertical"), HasSubstr("accept path-orientation"))));
}

TEST(PathOrientation, AcceptedByNameItIsANote) {
  const Verdict verdict = verdict_with({.accepted = true});
  EXPECT_THAT(verdict.reasons, IsEmpty());
  EXPECT_THAT(verdict.notes, Contains(HasSubstr("turned by 180 degrees about X, Y or Z")));
}

TEST(PathOrientation, ScalesThatAgreeAreEnough) {
  const Verdict verdict = verdict_with({.scales_agree = true});
  EXPECT_THAT(verdict.reasons, IsEmpty());
  EXPECT_THAT(verdict.notes, IsEmpty());
}

/// Gravity does not tell apart what differs by a turn about the vertical.
TEST(PathOrientation, ALevelledTrackerLeavesTheTurnAboutTheVerticalOpen) {
  EXPECT_THAT(verdict_with({.up = Vector3::UnitZ()}).reasons,
              ElementsAre(HasSubstr("turned by 180 degrees about Z (")));
}

TEST(PathOrientation, ThePlaceOfTheTrackerIsEnough) {
  EXPECT_THAT(verdict_with({.tracker_m = kTracker.t_m + Vector3(0.2, -0.2, 0.1)}).reasons, IsEmpty());
}

/// 0.4 m from the line along X through the target offset, a half turn moves the tracker by 0.8 m: not more
/// than twice what its place is known to.
TEST(PathOrientation, APlaceNearAnAxisLeavesTheTurnAboutItOpen) {
  const RigidTransform near_x{Matrix3::Identity(), {2.0, 0.7, -0.4}};
  EXPECT_THAT(verdict_with({.tracker_m = near_x.t_m}, near_x).reasons,
              ElementsAre(HasSubstr("degrees about X (")));
}

TEST(PathOrientation, APlaceThatFitsAfterAHalfTurnNamesIt) {
  EXPECT_THAT(
      verdict_with({.tracker_m = kTracker.t_m}, about_z(kTracker)).reasons,
      ElementsAre(AllOf(HasSubstr("from the place that is given"), HasSubstr("by 180 degrees about Z"),
                        HasSubstr("signs of the other two axes are reversed"))));
}

TEST(PathOrientation, ALevelledTrackerUpsideDownNamesTheFirstTurnThatHelps) {
  const Matrix3 turn = Vector3(1, -1, -1).asDiagonal();
  EXPECT_THAT(verdict_with({.up = Vector3::UnitZ()}, {turn, turn * kTracker.t_m}).reasons,
              ElementsAre(AllOf(HasSubstr("180 degrees off"), HasSubstr("by 180 degrees about X"))));
}

TEST(PathOrientation, EvidenceThatNoHalfTurnExplainsNamesWhatToCheck) {
  EXPECT_THAT(verdict_with({.tracker_m = Vector3(5, 5, 5)}).reasons,
              ElementsAre(HasSubstr("check the evidence and the axes of the path file")));
}

/// The whole way: X and Y reversed in the file, and nothing in the residuals.
TEST(PathOrientation, ATurnedPathIsRefusedByThePlaceOfTheTracker) {
  auto run = abbe::tests::otf::make_run({});
  for (Vector3& q : run.path.vertices_m) q = Vector3(-q.x(), -q.y(), q.z());
  run.options.orientation = {.tracker_m = run.T_machine_tracker.t_m};
  const auto id = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(id) << id.error().text;
  const auto verdict = judge(id->observations, id->solution, nullptr, {}, run.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_THAT(verdict->reasons, Contains(HasSubstr("180 degrees about Z")));
  run.options.orientation = {.scales_agree = true};
  EXPECT_TRUE(judge(id->observations, id->solution, nullptr, {}, run.options)->accepted)
      << "the residuals show it: no evidence is needed";
}

}  // namespace

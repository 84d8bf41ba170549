/// Evidence for the orientation of a path file in the machine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/judge/judge.hpp"
#include "abbe/calib/otf/observe/orientation.hpp"
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

/// The result of the alignment with X and Y reversed in the path file: the target moves by turn
/// q + offset.
RigidTransform about_z(RigidTransform T) {
  const Matrix3 turn = Vector3(-1, -1, 1).asDiagonal();
  return {turn * T.R, turn * (T.t_m - kTarget_m) + kTarget_m};
}

Matrix3 half_turn(double x, double y, double z) {
  return Vector3(x, y, z).asDiagonal();
}

TEST(PathOrientation, HalfTurnsThatStayInTheTravelArePossible) {
  EXPECT_THAT(possible_rotations(kPath, travels(-0.1, 0.1)),
              ElementsAre(half_turn(1, -1, -1), half_turn(-1, 1, -1), half_turn(-1, -1, 1)));
}

TEST(PathOrientation, ATravelOnOneSideOfZeroShowsReversedSigns) {
  Path path = kPath;
  for (Vector3& q : path.vertices_m) q.z() -= 0.2;
  EXPECT_THAT(possible_rotations(path, travels(-0.4, 0.0)), ElementsAre(half_turn(-1, -1, 1)));
}

/// Three equal travels about zero: every proper rotation of a cube but the identity.
TEST(PathOrientation, ACubeOfTravelsAllowsAll23Rotations) {
  const AxisNodes axis = *equidistant_nodes(-0.3, 0.3, 0.1);
  const auto turns = possible_rotations(kPath, {axis, axis, axis});
  EXPECT_EQ(turns.size(), 23u);
  for (const Matrix3& R : turns) {
    EXPECT_NEAR(R.determinant(), 1.0, 1e-12);
    EXPECT_TRUE((R * R.transpose()).isIdentity()) << R;
  }
}

/// X and Y of a path exchanged with one sign reversed: a quarter turn about Z.
TEST(PathOrientation, QuarterTurnsAreNamedByTheirColumns) {
  const MachineNodes equal{*equidistant_nodes(-0.3, 0.3, 0.1), *equidistant_nodes(-0.3, 0.3, 0.1),
                           *equidistant_nodes(-0.4, 0.0, 0.1)};
  Path path = kPath;
  for (Vector3& q : path.vertices_m) q.z() -= 0.2;
  Verdict open, contradicted;
  require_orientation(open, path, equal, kTarget_m, kTracker, {});
  EXPECT_THAT(open.reasons, ElementsAre(AllOf(HasSubstr("turned by 180 degrees about Z ("),
                                              HasSubstr("read as (-y, x, z) or (y, -x, z)"))));

  // Tracker found at the place turned by -90 degrees about Z.
  Matrix3 quarter = Matrix3::Zero();
  quarter(0, 1) = 1, quarter(1, 0) = -1, quarter(2, 2) = 1;
  const RigidTransform found{quarter * kTracker.R,
                             quarter * (kTracker.t_m - kTarget_m) + kTarget_m};
  require_orientation(contradicted, path, equal, kTarget_m, found, {.tracker_m = kTracker.t_m});
  EXPECT_THAT(contradicted.reasons,
              ElementsAre(HasSubstr("columns (x, y, z) of the path file read as (-y, x, z)")));
}

TEST(PathOrientation, WithoutEvidenceTheModelIsRefusedAndWhatHelpsIsNamed) {
  EXPECT_THAT(
      verdict_with({}).reasons,
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

/// Gravity does not distinguish orientations that differ by a turn about the vertical.
TEST(PathOrientation, ALevelledTrackerLeavesTheTurnAboutTheVerticalOpen) {
  EXPECT_THAT(verdict_with({.up = Vector3::UnitZ()}).reasons,
              ElementsAre(HasSubstr("turned by 180 degrees about Z (")));
}

TEST(PathOrientation, ThePlaceOfTheTrackerIsEnough) {
  EXPECT_THAT(verdict_with({.tracker_m = kTracker.t_m + Vector3(0.2, -0.2, 0.1)}).reasons,
              IsEmpty());
}

/// 0.4 m from the line along X through the target offset, a half turn moves the tracker by 0.8 m:
/// not more than twice the uncertainty of its position.
TEST(PathOrientation, APlaceNearAnAxisLeavesTheTurnAboutItOpen) {
  const RigidTransform near_x{Matrix3::Identity(), {2.0, 0.7, -0.4}};
  EXPECT_THAT(verdict_with({.tracker_m = near_x.t_m}, near_x).reasons,
              ElementsAre(HasSubstr("degrees about X (")));
}

TEST(PathOrientation, APlaceThatFitsAfterAHalfTurnNamesIt) {
  EXPECT_THAT(
      verdict_with({.tracker_m = kTracker.t_m}, about_z(kTracker)).reasons,
      ElementsAre(AllOf(HasSubstr("from the given position"), HasSubstr("by 180 degrees about Z"),
                        HasSubstr("signs of the other two axes are reversed"))));
}

TEST(PathOrientation, ALevelledTrackerUpsideDownNamesTheFirstTurnThatHelps) {
  const Matrix3 turn = Vector3(1, -1, -1).asDiagonal();
  EXPECT_THAT(
      verdict_with({.up = Vector3::UnitZ()}, {turn, turn * kTracker.t_m}).reasons,
      ElementsAre(AllOf(HasSubstr("180 degrees off"), HasSubstr("by 180 degrees about X"))));
}

TEST(PathOrientation, EvidenceThatNoHalfTurnExplainsNamesWhatToCheck) {
  EXPECT_THAT(verdict_with({.tracker_m = Vector3(5, 5, 5)}).reasons,
              ElementsAre(HasSubstr("check the evidence and the axes of the path file")));
}

/// The complete identification: X and Y are reversed in the file, and the residuals do not show it.
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

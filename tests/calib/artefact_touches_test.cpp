/// Touch plans for the calibration of a ball array: the touched points, and that the probe does not
/// collide on the way.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/evemu/plan/artefact_touches.hpp"

namespace abbe::calib::evemu {
namespace {

Calibrator array() {
  Calibrator c;
  c.name = "L";
  c.tip_radius_m = 2e-3;
  const std::array<Vector3, 5> centres{
      {{0, 0, 0}, {0.08, 0, 0}, {0.16, 0, 0.005}, {0, 0.08, 0}, {0, 0.16, 0}}};
  for (std::size_t i = 0; i < centres.size(); ++i)
    c.balls.push_back({static_cast<int>(i) + 1, centres[i], 12.5e-3, 0.0});
  c.blocks = {{1, {0, 0, 1}, 0.0}, {2, {0, -1, 0}, 0.0}};
  return c;
}
const std::array<FaceToTouch, 2> kFaces{{{{0.08, 0.08, 0.0}, 8e-3}, {{0.12, 0.05, 0.0}, 8e-3}}};

const Vector3 kLow{0.3, -0.2, -0.05};  // beside the artefact

ArtefactPlan whole_plan(const Vector3& from_m, const ArtefactTouchOptions& options = {}) {
  const auto c = array();
  return plan_artefact_touches(c, kFaces, from_m, options).value();
}
std::vector<PlannedTouch> plan(const ArtefactTouchOptions& options = {}) {
  return whole_plan(kLow, options).touches;
}

double distance_to_way(const Vector3& p, const Vector3& a, const Vector3& b) {
  const double length2 = (b - a).squaredNorm();
  const double s = length2 > 0.0 ? std::clamp((p - a).dot(b - a) / length2, 0.0, 1.0) : 0.0;
  return (a + s * (b - a) - p).norm();
}

TEST(ArtefactTouches, TouchesEveryFeatureAsOftenAsAsked) {
  std::map<std::pair<Feature, int>, int> count;
  for (const auto& t : plan({.points_per_ball = 9, .points_per_face = 5}))
    ++count[{t.feature, t.number}];
  for (int ball = 1; ball <= 5; ++ball) EXPECT_EQ((count[{Feature::Ball, ball}]), 9);
  for (int block = 1; block <= 2; ++block) EXPECT_EQ((count[{Feature::Block, block}]), 5);
}

TEST(ArtefactTouches, TouchesTheUpperHalfWithTheSurfaceOfTheTip) {
  const auto c = array();
  for (const auto& t : plan()) {
    if (t.feature != Feature::Ball) continue;
    const Vector3 from = t.at_m - c.balls[static_cast<std::size_t>(t.number) - 1].centre_m;
    EXPECT_NEAR(from.norm(), 14.5e-3, 1e-12);
    EXPECT_NEAR((from.normalized() - t.normal).norm(), 0.0, 1e-12);
    EXPECT_GT(t.normal.z(), 0.0);
  }
}

TEST(ArtefactTouches, NoWayLeadsThroughABall) {
  const auto c = array();
  for (const std::size_t points : {5u, 8u, 13u, 25u}) {
    Vector3 here = kLow;
    for (const auto& t : plan({.points_per_ball = points})) {
      for (const Vector3& place : t.way_m) {
        for (const auto& ball : c.balls)
          EXPECT_GT(distance_to_way(ball.centre_m, here, place), 1.3 * 14.5e-3);
        here = place;
      }
      // The last section of the way lies outward of the touch.
      EXPECT_NEAR((t.way_m.back() - t.at_m).normalized().dot(t.normal), 1.0, 1e-9);
    }
  }
}

double top_of_everything() {
  double top_m = 0.0;
  for (const auto& ball : array().balls) top_m = std::max(top_m, ball.centre_m.z() + 14.5e-3);
  return top_m;
}

TEST(ArtefactTouches, GoesUpFromWhereItStandsBeforeAnythingElse) {
  // Between two balls: the straight way to the point above the first ball passes through a ball.
  const Vector3 from{0.04, 0.0, -0.01};
  const auto way = whole_plan(from).touches.front().way_m;
  ASSERT_EQ(way.size(), 3u);
  EXPECT_NEAR((way[0] - from).head<2>().norm(), 0.0, 1e-12);
  EXPECT_GT(way[0].z(), top_of_everything());
  EXPECT_GT(way[1].z(), top_of_everything());
}

TEST(ArtefactTouches, DoesNotGoDownBeforeItGoesAcross) {
  const Vector3 from{0.3, 0.3, 0.5};
  const auto way = whole_plan(from).touches.front().way_m;
  ASSERT_EQ(way.size(), 2u);
  EXPECT_GT(way[0].z(), top_of_everything());
  EXPECT_NEAR((way[0] - way[1]).head<2>().norm(), 0.0, 1e-12);
}

TEST(ArtefactTouches, EndsAboveEverything) {
  const auto planned = whole_plan(kLow);
  const auto& last = planned.touches.back();
  ASSERT_EQ(planned.leave_m.size(), 2u);
  EXPECT_NEAR((planned.leave_m[0] - last.at_m).normalized().dot(last.normal), 1.0, 1e-9);
  EXPECT_NEAR((planned.leave_m[1] - planned.leave_m[0]).head<2>().norm(), 0.0, 1e-12);
  EXPECT_GT(planned.leave_m[1].z(), top_of_everything());
}

TEST(ArtefactTouches, RefusesATipWithABallAboveIt) {
  const auto under = plan_artefact_touches(array(), kFaces, {0.085, 0.0, -0.06}, {});
  ASSERT_FALSE(under);
  EXPECT_NE(under.error().text.find("ball 2 is above the tip"), std::string::npos)
      << under.error().text;
  // The position after a last touch on the ball's upper half.
  EXPECT_TRUE(plan_artefact_touches(array(), kFaces, {0.08 + 14.3e-3, 0.0, 2e-3}, {}));
}

TEST(ArtefactTouches, RefusesTooFewPoints) {
  EXPECT_FALSE(plan_artefact_touches(array(), kFaces, kLow, {.points_per_ball = 4}));
  EXPECT_FALSE(plan_artefact_touches(array(), kFaces, kLow, {.points_per_face = 3}));
}

TEST(ArtefactTouches, TheFewestTouchesAreEnough) {
  const auto c = array();
  std::vector<Touch> touches;
  for (const auto& t : plan({.points_per_ball = 5, .points_per_face = 4}))
    touches.push_back({1, t.feature, t.number, t.at_m});
  const auto found = calibrated_artefact(c, kFaces, touches, 0.0);
  ASSERT_TRUE(found) << found.error().text;
  for (std::size_t i = 0; i < c.balls.size(); ++i)
    EXPECT_LT((found->balls[i].centre_m - c.balls[i].centre_m).norm(), 1e-12);
}

TEST(ArtefactTouches, TheMeasuredArtefactGrowsAsTheNominalOne) {
  auto c = array();
  std::vector<Touch> touches;
  for (const auto& t : plan({.points_per_ball = 5, .points_per_face = 4}))
    touches.push_back({1, t.feature, t.number, t.at_m});
  EXPECT_FALSE(calibrated_artefact(c, kFaces, touches, 0.0)->expansivity);
  c.expansivity = {{11.5e-6, 0.5e-6}};
  const auto found = calibrated_artefact(c, kFaces, touches, 0.0);
  ASSERT_TRUE(found && found->expansivity);
  EXPECT_EQ(found->expansivity->alpha_per_K, 11.5e-6);
  EXPECT_EQ(found->expansivity->u_alpha_per_K, 0.5e-6);
}

TEST(ArtefactTouches, MovedTouchesGiveTheArtefactThere) {
  const RigidTransform T{Eigen::AngleAxisd(0.3, Vector3::UnitZ()).toRotationMatrix(),
                         {0.5, 0.4, 0.1}};
  const auto there = moved(array(), T);
  std::array<FaceToTouch, 2> faces = kFaces;
  for (auto& face : faces) face.centre_m = T * face.centre_m;
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, 0.2e-6);
  std::vector<Touch> touches;
  const auto planned = plan_artefact_touches(there, faces, T * kLow, {});
  ASSERT_TRUE(planned) << planned.error().text;
  for (const auto& t : planned->touches)
    touches.push_back({1, t.feature, t.number, t.at_m + noise(random) * t.normal});
  const auto found = calibrated_artefact(there, faces, touches, 0.3e-6);
  ASSERT_TRUE(found) << found.error().text;

  for (std::size_t i = 0; i < found->balls.size(); ++i) {
    EXPECT_LT((found->balls[i].centre_m - there.balls[i].centre_m).norm(), 4 * found->balls[i].u_m);
    EXPECT_GE(found->balls[i].u_m, 0.3e-6);
    EXPECT_LT(found->balls[i].u_m, 0.6e-6);
  }

  EXPECT_LT((found->blocks[1].normal - there.blocks[1].normal).norm(), 4 * found->blocks[1].u_rad);
}

}  // namespace
}  // namespace abbe::calib::evemu

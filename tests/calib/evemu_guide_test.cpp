/// The reference touches of the whole artefact, passed to the guide one by one in the order of its
/// plan, and the guide's messages after wrong touches.
#include "abbe/calib/evemu/live/touch_guide.hpp"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <numbers>
#include <tuple>

#include "abbe/calib/fit/plane.hpp"
#include "abbe/calib/fit/sphere.hpp"
#include "evemu_run.hpp"

namespace abbe::calib::evemu {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::SizeIs;

/// Touches every feature of the plan in order; `leave_out` selects touches that are not made.
class Toucher {
 public:
  explicit Toucher(TouchGuide guide) : guide_(std::move(guide)) {
    for (const Touch& t : tests::evemu::reference_touches("touched_noiseless.csv"))
      points_[{t.position, t.feature, t.number}].push_back(t.p_m);
  }

  [[nodiscard]] const std::vector<Vector3>& points(int position, Feature feature,
                                                   int number) const {
    return points_.at({position, feature, number});
  }
  GuidedTouch touch(const Vector3& p_m) {
    GuidedTouch done = guide_.take(p_m);
    notes_.insert(notes_.end(), done.notes.begin(), done.notes.end());
    return done;
  }
  /// Touches the first `count` points of a feature; nullopt: all.
  void touch_all(int position, Feature feature, int number, std::size_t count = 1000) {
    const auto& all = points(position, feature, number);
    for (std::size_t i = 0; i < std::min(count, all.size()); ++i) touch(all[i]);
  }
  void touch_position(int position, int from_ball = 1) {
    if (from_ball == 1) {
      touch_all(position, Feature::Ball, 1);
      touch_all(position, Feature::Block, 1);
      touch_all(position, Feature::Block, 2);
      from_ball = 2;
    }
    for (int ball = from_ball; ball <= 9; ++ball) touch_all(position, Feature::Ball, ball);
  }

  TouchGuide guide_;
  std::vector<std::string> notes_;

 private:
  std::map<std::tuple<int, Feature, int>, std::vector<Vector3>> points_;
};

Toucher toucher(Calibrator calibrator = tests::evemu::reference_calibrator()) {
  return Toucher(*TouchGuide::create(std::move(calibrator), {}));
}

TEST(TouchGuide, FollowsTheWholeProcedureWithoutAWord) {
  Toucher t = toucher();
  for (const int position : TouchPlan{}.positions) {
    ASSERT_FALSE(t.guide_.complete());
    EXPECT_EQ(t.guide_.next().position, position);
    EXPECT_EQ(name(t.guide_.next().on), "ball 1");
    t.touch_position(position);
  }
  EXPECT_TRUE(t.guide_.complete());
  EXPECT_THAT(t.notes_, SizeIs(0));
  EXPECT_EQ(t.guide_.taken(), t.guide_.planned());
}

TEST(TouchGuide, HandsOverWhatTheTouchesWereMadeOn) {
  Toucher t = toucher();
  for (const int position : TouchPlan{}.positions) t.touch_position(position);
  const auto run = t.guide_.touches();
  const auto guided =
      observe(run, tests::evemu::reference_calibrator(), tests::evemu::reference_machine());
  const auto reference =
      observe(tests::evemu::reference_touches("touched_noiseless.csv"),
              tests::evemu::reference_calibrator(), tests::evemu::reference_machine());
  ASSERT_TRUE(guided && reference);
  ASSERT_EQ(guided->rows.size(), reference->rows.size());
  for (std::size_t i = 0; i < guided->rows.size(); ++i)
    EXPECT_LT((guided->rows[i].V_m - reference->rows[i].V_m).norm(), 1e-12);
}

TEST(TouchGuide, SaysBallOneThenTheBlocksThenTheOtherBalls) {
  Toucher t = toucher();
  std::vector<std::string> order{name(t.guide_.next().on)};
  const std::vector<TouchedFeature> touched{
      {Feature::Ball, 1}, {Feature::Block, 1}, {Feature::Block, 2}};
  for (const auto& [feature, number] : touched) {
    t.touch_all(4, feature, number);
    order.push_back(name(t.guide_.next().on));
  }
  EXPECT_THAT(order, testing::ElementsAre("ball 1", "block 1", "block 2", "ball 2"));
}

TEST(TouchGuide, CountsThePointsOfEachFeatureOfThePosition) {
  Toucher t = toucher();
  t.touch_all(4, Feature::Ball, 1);
  t.touch_all(4, Feature::Block, 1, 3);
  const auto features = t.guide_.features();
  ASSERT_THAT(features, SizeIs(11));
  EXPECT_EQ(features[0].touched, 25u);
  EXPECT_EQ(name(features[1].on), "block 1");
  EXPECT_EQ(features[1].touched, 3u);
  EXPECT_EQ(features[10].touched, 0u);
}

TEST(TouchGuide, KnowsWhereTheArrayStandsFromFacesAndSomeBalls) {
  Toucher t = toucher();
  EXPECT_FALSE(t.guide_.features()[0].at_m);
  t.touch_all(4, Feature::Ball, 1);
  t.touch_all(4, Feature::Block, 1);
  t.touch_all(4, Feature::Block, 2);
  EXPECT_TRUE(t.guide_.features()[0].at_m);
  EXPECT_TRUE(t.guide_.features()[2].at_m);
  EXPECT_FALSE(t.guide_.features()[2].normal) << "to which side the block faces is open";
  EXPECT_FALSE(t.guide_.features()[10].at_m) << "on which side of the faces the balls lie is open";

  int ball = 2;
  while (ball < 9 && !t.guide_.features()[10].at_m) t.touch_all(4, Feature::Ball, ball++);
  const auto ball9 = t.guide_.features()[10].at_m;
  ASSERT_TRUE(ball9) << "before it was touched";
  const Vector3 measured = fit::fit_sphere(t.points(4, Feature::Ball, 9))->centre;
  EXPECT_LT((*ball9 - measured).norm(), GuideOptions{}.max_off_expected_m);
}

/// The rotation from the calibrator to the machine, by the reported places of the balls.
Matrix3 rotation_of(const Calibrator& calibrator, const std::vector<FeatureProgress>& features) {
  Eigen::Matrix3Xd stated(3, 0), reported(3, 0);
  for (const FeatureProgress& f : features) {
    if (f.on.feature != Feature::Ball || !f.at_m) continue;
    const auto columns = stated.cols() + 1;
    stated.conservativeResize(3, columns);
    reported.conservativeResize(3, columns);
    stated.rightCols<1>() = calibrator.balls[static_cast<std::size_t>(f.on.number) - 1].centre_m;
    reported.rightCols<1>() = *f.at_m;
  }
  return Eigen::umeyama(stated, reported, false).topLeftCorner<3, 3>();
}

/// The calibrator, or one whose block 2 faces to the other side.
class SidesOfABlock : public testing::TestWithParam<double> {};

TEST_P(SidesOfABlock, ItsNormalPointsWhereTheCalibratorStates) {
  Calibrator calibrator = tests::evemu::reference_calibrator();
  calibrator.blocks[1].normal *= GetParam();
  Toucher t = toucher(calibrator);
  t.touch_all(4, Feature::Ball, 1);
  t.touch_all(4, Feature::Block, 1);
  t.touch_all(4, Feature::Block, 2);
  for (int ball = 2; ball < 9; ++ball) t.touch_all(4, Feature::Ball, ball);
  const auto features = t.guide_.features();
  const Matrix3 R_machine_array = rotation_of(calibrator, features);
  for (const std::size_t block : {std::size_t{1}, std::size_t{2}}) {
    ASSERT_TRUE(features[block].normal);
    const Vector3 stated = R_machine_array * calibrator.blocks[block - 1].normal.normalized();
    EXPECT_GT(features[block].normal->dot(stated), 0.99);  // machine errors turn it by some mrad
  }
}

INSTANTIATE_TEST_SUITE_P(TouchGuide, SidesOfABlock, testing::Values(1.0, -1.0));

TEST(TouchGuide, BallOneOfThePreviousPositionIsNotReportedAtTheNext) {
  Toucher t = toucher();
  t.touch_position(4);
  ASSERT_EQ(t.guide_.next().position, 8);
  EXPECT_FALSE(t.guide_.features()[0].at_m);
  t.touch_all(8, Feature::Ball, 1);
  EXPECT_TRUE(t.guide_.features()[0].at_m);
}

TEST(TouchGuide, ATouchInTheSamePlaceCountsOnce) {
  Toucher t = toucher();
  const Vector3 p = t.points(4, Feature::Ball, 1)[0];
  t.touch(p);
  EXPECT_EQ(t.touch(p + Vector3(3e-6, -2e-6, 4e-6)).fate, TouchFate::SamePlace);
  EXPECT_EQ(t.guide_.next().touched, 1u);
  EXPECT_THAT(t.notes_.back(), HasSubstr("position 4: the same place on ball 1 was touched twice"));
}

TEST(TouchGuide, AFinishedBallTouchedAgainIsSaidAndNotUsed) {
  Toucher t = toucher();
  t.touch_all(4, Feature::Ball, 1);
  const Vector3 centre = fit::fit_sphere(t.points(4, Feature::Ball, 1))->centre;
  EXPECT_EQ(t.touch(centre + 12.7e-3 * Vector3(1, 2, 2) / 3).fate, TouchFate::Doubled);
  EXPECT_THAT(t.notes_.back(), HasSubstr("ball 1 has all its 25 points"));
  EXPECT_THAT(t.notes_.back(), HasSubstr("expected: block 1"));
  t.touch_all(4, Feature::Block, 1);
  t.touch_all(4, Feature::Block, 2);
  t.touch_position(4, 2);
  EXPECT_EQ(t.guide_.next().position, 8);
}

TEST(TouchGuide, AMissedTouchIsSaidWhenTheNextBallBeginsAndNothingIsLost) {
  Toucher t = toucher();
  t.touch_all(4, Feature::Ball, 1);
  t.touch_all(4, Feature::Block, 1);
  t.touch_all(4, Feature::Block, 2);
  t.touch_all(4, Feature::Ball, 2, 24);
  t.touch_position(4, 3);
  EXPECT_THAT(t.notes_,
              testing::ElementsAre(HasSubstr("ball 2 has 24 of 25 points, the rest was missed")));
  EXPECT_EQ(t.guide_.next().position, 8);
  EXPECT_EQ(t.guide_.taken(), 11u * 25u - 1u);
}

TEST(TouchGuide, ABallLeftOutIsAskedForAtTheEndOfThePosition) {
  Toucher t = toucher();
  t.touch_all(4, Feature::Ball, 1);
  t.touch_all(4, Feature::Block, 1);
  t.touch_all(4, Feature::Block, 2);
  t.touch_position(4, 3);
  EXPECT_THAT(t.notes_,
              testing::ElementsAre(HasSubstr("ball 2 was left out; it is asked for again")));
  EXPECT_EQ(t.guide_.next().position, 4);
  EXPECT_EQ(name(t.guide_.next().on), "ball 2");
  t.touch_all(4, Feature::Ball, 2);
  EXPECT_EQ(t.guide_.next().position, 8);
}

TEST(TouchGuide, AMissedTouchOnABlockDoesNotConfuseTheFaces) {
  Toucher t = toucher();
  t.touch_all(4, Feature::Ball, 1);
  t.touch_all(4, Feature::Block, 1, 23);
  t.touch_all(4, Feature::Block, 2);
  t.touch_position(4, 2);
  EXPECT_THAT(t.notes_, testing::ElementsAre(HasSubstr("block 1 has 23 of 25 points")));
  EXPECT_EQ(t.guide_.next().position, 8);
}

TEST(TouchGuide, ATouchFarFromAnyBallIsSaidWithTheNearestAndTheExpected) {
  Toucher t = toucher();
  t.touch_all(4, Feature::Ball, 1);
  t.touch_all(4, Feature::Block, 1);
  t.touch_all(4, Feature::Block, 2);
  const Vector3 p = t.points(4, Feature::Ball, 2)[0] + Vector3(0, 0, 0.05);
  EXPECT_EQ(t.touch(p).fate, TouchFate::NotOnFeature);
  EXPECT_THAT(t.notes_.back(), HasSubstr("is on no ball or block; nearest is ball 2, "));
  EXPECT_THAT(t.notes_.back(), HasSubstr("expected: ball 2"));
  t.touch_position(4, 2);
  EXPECT_EQ(t.guide_.next().position, 8);
}

/// Position of a ball if block 2 faced the opposite side: before a ball was touched, the touches do
/// not determine the side.
Vector3 mirrored_centre(const Toucher& t, int position, int ball) {
  const Vector3 ball1 = fit::fit_sphere(t.points(position, Feature::Ball, 1))->centre;
  const Vector3 centre = fit::fit_sphere(t.points(position, Feature::Ball, ball))->centre;
  const Vector3 n1 =
      fit::fit_plane(t.points(position, Feature::Block, 1), Vector3::UnitZ())->normal;
  return ball1 + Eigen::AngleAxisd(std::numbers::pi, n1) * (centre - ball1);
}

Vector3 stray_at_mirrored(const Toucher& t, int position, int ball) {
  return mirrored_centre(t, position, ball) + Vector3(0, 0, 12.7e-3 + 2e-3);
}

class StrayOnAMirroredBall : public testing::TestWithParam<int> {};

TEST_P(StrayOnAMirroredBall, CostsNothing) {
  Toucher t = toucher();
  t.touch_all(4, Feature::Ball, 1);
  t.touch_all(4, Feature::Block, 1);
  t.touch_all(4, Feature::Block, 2);
  t.touch(stray_at_mirrored(t, 4, GetParam()));
  t.touch_position(4, 2);
  EXPECT_FALSE(t.guide_.failure());
  EXPECT_EQ(t.guide_.next().position, 8);
  EXPECT_THAT(t.notes_, Contains(HasSubstr("discarded")));
}

INSTANTIATE_TEST_SUITE_P(TouchGuide, StrayOnAMirroredBall, testing::Values(2, 5, 9));

TEST(TouchGuide, AStrayTouchThatWentOnDoesNotChangeWhatComesNext) {
  Toucher t = toucher();
  t.touch_all(4, Feature::Ball, 1);
  t.touch_all(4, Feature::Block, 1);
  t.touch_all(4, Feature::Block, 2);
  t.touch(stray_at_mirrored(t, 4, 9));
  t.touch_all(4, Feature::Ball, 2);
  EXPECT_THAT(t.notes_.back(), HasSubstr("1 earlier touch is on no ball, as ball 2 shows"));
  EXPECT_EQ(name(t.guide_.next().on), "ball 3");
}

TEST(TouchGuide, KnowsTheSidesOfTheFacesAtLaterPositions) {
  Toucher t = toucher();
  t.touch_position(4);
  t.touch_all(8, Feature::Ball, 1);
  t.touch_all(8, Feature::Block, 1);
  t.touch_all(8, Feature::Block, 2);
  EXPECT_EQ(t.touch(stray_at_mirrored(t, 8, 2)).fate, TouchFate::NotOnFeature);
  t.touch_position(8, 2);
  EXPECT_EQ(t.guide_.next().position, 3);
}

TEST(TouchGuide, FacesSetAsideWhenSomebodyWentOnAreTouchedAgain) {
  Toucher t = toucher();
  t.touch_all(4, Feature::Ball, 1);
  t.touch_all(4, Feature::Block, 1);

  // Tilted towards block 1: Ball2 is where it was, the angle between the faces differs.
  const auto& face = t.points(4, Feature::Block, 2);
  const Vector3 n1 = fit::fit_plane(t.points(4, Feature::Block, 1), Vector3::UnitZ())->normal;
  const auto plane = *fit::fit_plane(face, Vector3::UnitX());
  const Eigen::AngleAxisd lean(0.1, n1.cross(plane.normal).normalized());
  for (std::size_t i = 0; i < 24; ++i) t.touch(plane.point + lean * (face[i] - plane.point));
  EXPECT_EQ(t.touch(t.points(4, Feature::Ball, 2)[0]).fate, TouchFate::NotOnFeature);
  EXPECT_THAT(t.notes_.back(), HasSubstr("mrad off the calibrator's angle"));
  EXPECT_EQ(name(t.guide_.next().on), "block 1");
  t.touch_all(4, Feature::Block, 1);
  t.touch_all(4, Feature::Block, 2);
  t.touch_position(4, 2);
  EXPECT_EQ(t.guide_.next().position, 8);
}

TEST(TouchGuide, ATouchOffTheOthersOfItsBallIsSetAsideAndAnotherAsked) {
  Toucher t = toucher();
  t.touch(t.points(4, Feature::Ball, 1)[0] + Vector3(0, 0, 2e-3));
  for (std::size_t i = 1; i < 25; ++i) t.touch(t.points(4, Feature::Ball, 1)[i]);
  EXPECT_THAT(t.notes_.back(), HasSubstr("mm off the others of ball 1: discarded"));
  EXPECT_EQ(t.guide_.next().touched, 24u);
  t.touch(t.points(4, Feature::Ball, 1)[0]);
  EXPECT_EQ(name(t.guide_.next().on), "block 1");
}

TEST(TouchGuide, AnArtefactThatWasNotTurnedIsNotAnotherPosition) {
  Toucher t = toucher();
  t.touch_position(4);
  ASSERT_EQ(t.guide_.next().position, 8);
  t.touch_position(4);
  EXPECT_THAT(t.notes_.back(), HasSubstr("the same orientation as at position 4: turn it"));
  EXPECT_EQ(t.guide_.next().position, 8);
  t.touch_position(8);
  EXPECT_EQ(t.guide_.next().position, 3);
}

TEST(TouchGuide, ACalibratorWithOtherBallsIsRefusedAtTheFirst) {
  auto other = tests::evemu::reference_calibrator();
  for (auto& ball : other.balls) ball.radius_m = 10e-3;
  Toucher t = toucher(other);
  t.touch_all(4, Feature::Ball, 1);
  ASSERT_TRUE(t.guide_.failure());
  EXPECT_THAT(t.guide_.failure()->text,
              HasSubstr("calibrator file of another artefact, or another tip"));
}

TEST(TouchGuide, ACalibratorWithBallsElsewhereIsRefusedWhenTouchesGoAstray) {
  auto other = tests::evemu::reference_calibrator();
  for (auto& ball : other.balls) ball.centre_m *= 1.2;
  Toucher t = toucher(other);
  t.touch_position(4);
  ASSERT_TRUE(t.guide_.failure());
  EXPECT_THAT(t.guide_.failure()->text, HasSubstr("on no ball or block of calibrator \"L array\""));
}

TEST(TouchGuide, RefusesAPlanWithAPositionTwice) {
  const auto guide =
      TouchGuide::create(tests::evemu::reference_calibrator(), {.positions = {1, 2, 2}});
  ASSERT_FALSE(guide);
  EXPECT_THAT(guide.error().text, HasSubstr("each once"));
}

}  // namespace
}  // namespace abbe::calib::evemu

// One touch of a ball or face is 0.5 mm off, in runs with fewer touches than the campaign.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <utility>

#include "evemu_run.hpp"

namespace {
using namespace abbe::tests::never_worse;
using abbe::calib::Vector3;
using abbe::calib::evemu::Feature;
using abbe::calib::evemu::Touch;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr double kOff_m = 0.5e-3;

/// A touch, with its number among those of its ball or face, from 1.
struct Place {
  Touch touch;
  std::string number;  ///< "touch 3 of 10"

  [[nodiscard]] std::string feature() const {
    return (touch.feature == Feature::Ball ? "ball " : "block ") + std::to_string(touch.number);
  }
};

bool same_feature(const Touch& a, const Touch& b) {
  return a.position == b.position && a.feature == b.feature && a.number == b.number;
}

/// Displaces a touch along the normal of its surface.
Place displace_one(std::vector<Touch>& touches, Feature feature, std::uint64_t seed, double by_m) {
  std::mt19937_64 random(seed);
  std::size_t at = 0;
  do {
    at = random() % touches.size();
  } while (touches[at].feature != feature);

  Touch& bad = touches[at];
  Vector3 sum = Vector3::Zero();
  int count = 0, number = 0;
  for (const Touch& t : touches) {
    if (!same_feature(t, bad)) continue;
    sum += t.p_m;
    ++count;
    if (&t == &bad) number = count;
  }

  const Vector3 outward = feature == Feature::Ball ? Vector3(bad.p_m - sum / count)
                          : bad.number == 1        ? Vector3(Vector3::UnitZ())
                                                   : Vector3(Vector3::UnitY());
  bad.p_m += by_m * outward.normalized();
  return {bad, "touch " + std::to_string(number) + " of " + std::to_string(count)};
}

struct Run {
  Outcome outcome;
  Place place;
};

constexpr std::uint64_t kFirstSeed = 20000;

Run run_with(std::size_t touches_per_ball, Feature feature, std::uint64_t seed, double by_m) {
  EvemuRun run = random_evemu_run(kFirstSeed + seed);
  run.points_per_ball = touches_per_ball;
  run.points_per_face = std::max<std::size_t>(4, touches_per_ball * 2 / 3);
  Run result;
  run.spoil = [&](std::vector<Touch>& touches) {
    result.place = displace_one(touches, feature, seed, by_m);
  };
  result.outcome = identify_and_compare_evemu(std::move(run));
  return result;
}

TEST(EvemuFalseTouch, IsNotFoundInASoundRunOfFewTouches) {
  for (const std::size_t count : {10u, 5u}) {
    EXPECT_TRUE(run_with(count, Feature::Ball, 2, 0.0).outcome.accepted) << count;
  }
}

// The false touch displaces the fitted ball by up to 0.2 mm, so that linearised residuals of the
// other touches are wrong by um.
TEST(EvemuFalseTouch, OfABallIsNamed) {
  for (const auto& [seed, by_m] : {std::pair{3u, kOff_m}, std::pair{4u, -kOff_m}}) {
    const auto [outcome, place] = run_with(10, Feature::Ball, seed, by_m);
    EXPECT_FALSE(outcome.accepted);
    EXPECT_THAT(outcome.first_reason, AllOf(HasSubstr(place.feature()), HasSubstr(place.number)));
  }
}

// Five or six touches and four unknowns leave one or two redundant touches, which do not show the
// false one; so the radius is taken from the other positions.
TEST(EvemuFalseTouch, AmongFewOfABallIsNamedByTheRadius) {
  for (const std::size_t count : {6u, 5u}) {
    const auto [outcome, place] = run_with(count, Feature::Ball, 5, kOff_m);
    EXPECT_FALSE(outcome.accepted);
    EXPECT_THAT(outcome.first_reason, AllOf(HasSubstr(place.feature()), HasSubstr(place.number)));
  }
}

TEST(EvemuFalseTouch, ThatChangesTheRadiusOfOneBallIsNotAnotherArtefact) {
  const auto [outcome, place] = run_with(5, Feature::Ball, 4, -kOff_m);
  EXPECT_THAT(outcome.first_reason,
              AllOf(HasSubstr(place.feature()), HasSubstr("one of its 5 touches"),
                    Not(HasSubstr("another artefact"))));
}

TEST(EvemuFalseTouch, OfAFaceIsNamed) {
  const auto [outcome, place] = run_with(13, Feature::Block, 1, kOff_m);
  EXPECT_FALSE(outcome.accepted);
  EXPECT_THAT(outcome.first_reason, AllOf(HasSubstr(place.feature()), HasSubstr(place.number)));
}

TEST(EvemuFalseTouch, AmongFourOfAFaceIsReportedWithoutANumber) {
  const auto [outcome, place] = run_with(6, Feature::Block, 1, kOff_m);
  EXPECT_FALSE(outcome.accepted);
  EXPECT_THAT(outcome.first_reason,
              AllOf(HasSubstr(place.feature()), HasSubstr("one of its 4 touches")));
}

}  // namespace

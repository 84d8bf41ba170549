#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "abbe/calib/probe/delay.hpp"

namespace abbe::calib::probe {
namespace {

struct Truth {
  double delay_s = 2e-3;
  double jitter_s = 20e-6;
  double scatter_m = 0.2e-6;
};

std::vector<FeedTouch> touches(const Truth& truth, const std::vector<double>& feeds_m_s, int each,
                               std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::vector<FeedTouch> out;
  for (const double feed : feeds_m_s) {
    for (int i = 0; i < each; ++i) {
      const double v = feed * (1.0 + 0.002 * normal(random));  // no control keeps a feed exactly
      const double delay = truth.delay_s + truth.jitter_s * normal(random);
      out.push_back({v, 0.7 + v * delay + truth.scatter_m * normal(random)});
    }
  }
  return out;
}

const std::vector<double> kThreeFeeds = {1e-3, 4e-3, 8e-3};

TEST(ProbeDelay, IsExactWithoutNoise) {
  std::mt19937 random(1);
  const auto fit = fit_delay(touches({.jitter_s = 0.0, .scatter_m = 0.0}, kThreeFeeds, 3, random));
  ASSERT_TRUE(fit) << fit.error().text;
  EXPECT_NEAR(fit->delay_s, 2e-3, 1e-9);
  EXPECT_NEAR(fit->origin_m, 0.7, 1e-11);
  EXPECT_EQ(fit->feeds, 3u);
}

TEST(ProbeDelay, FindsAFallingPlaceAsANegativeDelay) {
  std::mt19937 random(2);
  const auto fit = fit_delay(touches({.delay_s = -1e-3}, kThreeFeeds, 20, random));
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->delay_s, -1e-3, 6 * fit->u_delay_s);
}

/// Of 2000 calibrations of a probe: the fraction in which the truth is within 1.96 u, and the
/// estimated jitter.
struct Coverage {
  double share = 0.0;
  double jitter_s = 0.0;
};
Coverage coverage(const Truth& truth, const std::vector<double>& feeds_m_s, int each) {
  std::mt19937 random(3);
  int held = 0;
  double jitter_s2 = 0.0;
  constexpr int kRuns = 2000;
  for (int run = 0; run < kRuns; ++run) {
    const auto fit = fit_delay(touches(truth, feeds_m_s, each, random)).value();
    held += std::abs(fit.delay_s - truth.delay_s) <= 1.96 * fit.u_delay_s ? 1 : 0;
    jitter_s2 += fit.u_jitter_s * fit.u_jitter_s / kRuns;
  }
  return {static_cast<double>(held) / kRuns, std::sqrt(jitter_s2)};
}

TEST(ProbeDelay, StatesItsUncertainty) {
  const Truth truth{.jitter_s = 50e-6};
  const Coverage c = coverage(truth, kThreeFeeds, 25);
  EXPECT_GE(c.share, 0.94);
  EXPECT_LE(c.share, 0.975);
  EXPECT_NEAR(c.jitter_s, truth.jitter_s, 0.15 * truth.jitter_s);
}

/// Nine touches determine their scatter to a quarter: without Student's factor the coverage would
/// be 88 %.
TEST(ProbeDelay, StatesAnUncertaintyThatHoldsForFewTouches) {
  for (const double jitter_s : {1e-6, 50e-6}) {
    const Coverage c = coverage({.jitter_s = jitter_s}, kThreeFeeds, 3);
    EXPECT_GE(c.share, 0.94) << jitter_s;
    EXPECT_LE(c.share, 0.985) << jitter_s;
  }
  EXPECT_GE(coverage({}, {1e-3, 2e-3, 3e-3, 4e-3, 6e-3, 8e-3}, 3).share, 0.93);
}

/// The same with three feeds: their lack of fit has one degree of freedom, so that Student's factor
/// is that of t with one degree of freedom.
TEST(ProbeDelay, StatesAnUncertaintyThatHoldsWhereThreeFeedsDoNotAgree) {
  std::mt19937 random(8);
  std::normal_distribution<double> normal;
  int held = 0;
  constexpr int kRuns = 2000;

  for (int run = 0; run < kRuns; ++run) {
    auto some = touches({.jitter_s = 0.0}, kThreeFeeds, 10, random);
    for (int feed = 0; feed < 3; ++feed) {
      const double off_m = 5e-6 * normal(random);
      for (int i = 0; i < 10; ++i) some[static_cast<std::size_t>(10 * feed + i)].along_m += off_m;
    }
    const auto fit = fit_delay(some).value();
    held += std::abs(fit.delay_s - Truth{}.delay_s) <= 1.96 * fit.u_delay_s ? 1 : 0;
  }

  EXPECT_NEAR(static_cast<double>(held) / kRuns, 0.95,
              0.015);  // three standard deviations of the share
}

/// Every feed has its own error (the surface was warmer, the control overshot): the touches at one
/// feed do not show it, the lack_of_fit does.
TEST(ProbeDelay, WidensItsUncertaintyWhereTheFeedsDoNotAgree) {
  std::mt19937 random(7);
  auto some = touches({.jitter_s = 0.0}, {1e-3, 3e-3, 5e-3, 8e-3}, 20, random);
  const auto before = fit_delay(some).value();
  for (std::size_t i = 0; i < some.size(); ++i)
    some[i].along_m += i / 20 % 2 == 0 ? 0.2e-6 : -0.2e-6;
  const auto after = fit_delay(some).value();

  ASSERT_GT(after.lack_of_fit, 4.0);
  ASSERT_LT(before.lack_of_fit, 1.0);
  EXPECT_EQ(before.dof, 76.0);
  EXPECT_EQ(after.dof, 2.0);
  constexpr double kStudent2Over76 = 4.3027 / 1.9917;
  EXPECT_NEAR(after.u_delay_s / before.u_delay_s, kStudent2Over76 * std::sqrt(after.lack_of_fit),
              0.05 * kStudent2Over76 * std::sqrt(after.lack_of_fit));
}

TEST(ProbeDelay, ShowsPlacesThatLieOnNoLine) {
  std::mt19937 random(4);
  auto bent = touches({.jitter_s = 0.0}, {1e-3, 3e-3, 5e-3, 8e-3}, 20, random);
  const auto straight = fit_delay(bent);
  for (FeedTouch& t : bent) t.along_m += 0.05 * t.speed_m_s * t.speed_m_s;  // 3 um at 8 mm/s
  const auto fit = fit_delay(bent);
  ASSERT_TRUE(straight && fit);
  EXPECT_LT(straight->lack_of_fit, 5.0);
  EXPECT_GT(fit->lack_of_fit, 20.0);
}

TEST(ProbeDelay, WantsThreeFeedsFarEnoughApart) {
  std::mt19937 random(5);
  EXPECT_EQ(fit_delay(touches({}, {1e-3, 8e-3}, 10, random)).error().code,
            ErrorCode::TooFewObservations);
  EXPECT_EQ(fit_delay(touches({}, kThreeFeeds, 2, random)).error().code,
            ErrorCode::TooFewObservations);
  EXPECT_EQ(fit_delay(touches({}, {3e-3, 4e-3, 5e-3}, 10, random)).error().code,
            ErrorCode::DegenerateGeometry);
  EXPECT_EQ(fit_delay({}).error().code, ErrorCode::TooFewObservations);
}

TEST(ProbeDelay, RefusesWhatIsNoTouch) {
  std::mt19937 random(6);
  auto some = touches({}, kThreeFeeds, 5, random);
  some[3].along_m = std::nan("");
  EXPECT_EQ(fit_delay(some).error().code, ErrorCode::NotFinite);
  some[3] = {0.0, 0.0};
  EXPECT_EQ(fit_delay(some).error().code, ErrorCode::BadInput);
}

}  // namespace
}  // namespace abbe::calib::probe

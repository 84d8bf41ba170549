#include "abbe/drivers/sampling/double_touch.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::DoubleTouch;
using drivers::DoubleTouchRules;
using drivers::TouchRejection;
using protocol::ProbeTrigger;
using protocol::TouchFlag;

ProbeTrigger touch_at(double z_m, double speed_m_s) {
  ProbeTrigger t;
  t.axis_count = 3;
  t.position = {0.1, 0.2, z_m};
  t.velocity = {0.0, 0.0, -speed_m_s};
  t.u_position.fill(5e-9);
  t.speed_m_s = speed_m_s;
  return t;
}

TEST(DoubleTouch, AveragesTheSlowTouches) {
  DoubleTouch both{DoubleTouchRules{}};
  EXPECT_FALSE(both.on_touch(touch_at(0.3 + 8e-6, 0.005)));
  EXPECT_FALSE(both.on_touch(touch_at(0.3 + 2e-7, 0.001)));
  const auto point = both.on_touch(touch_at(0.3 - 2e-7, 0.001));
  ASSERT_TRUE(point && *point);
  EXPECT_NEAR((*point)->position[2], 0.3, 1e-15);
  EXPECT_NEAR((*point)->spread_m, 4e-7, 1e-15);
  EXPECT_EQ((*point)->touches, 2u);
}

TEST(DoubleTouch, RefusesTouchesThatDisagree) {
  DoubleTouchRules rules;
  rules.agree_sigmas = 3.0;
  const double limit_m = 3.0 * std::sqrt(2.0) * std::hypot(0.25e-6, 5e-9);

  for (const double apart : {0.99, 1.01}) {
    DoubleTouch both{rules};
    (void)both.on_touch(touch_at(0.3, 0.005));
    (void)both.on_touch(touch_at(0.3, 0.001));
    const auto point = both.on_touch(touch_at(0.3 + apart * limit_m, 0.001));
    ASSERT_TRUE(point);
    EXPECT_EQ(point->has_value(), apart < 1.0);
    if (!point->has_value()) {
      EXPECT_EQ(point->error(), TouchRejection::Disagree);
    }
  }
}

TEST(DoubleTouch, RequiresAFindFirst) {
  DoubleTouch both{DoubleTouchRules{}};
  const auto point = both.on_touch(touch_at(0.3, 0.001));
  ASSERT_TRUE(point);
  EXPECT_EQ(point->error(), TouchRejection::NoFastTouch);
}

TEST(DoubleTouch, RefusesASlowTouchElsewhere) {
  DoubleTouch both{DoubleTouchRules{}};
  (void)both.on_touch(touch_at(0.301, 0.005));
  const auto point = both.on_touch(touch_at(0.3, 0.001));
  ASSERT_TRUE(point);
  EXPECT_EQ(point->error(), TouchRejection::OtherPlace);
}

TEST(DoubleTouch, RefusesASlowTouchFromTheOtherSide) {
  DoubleTouch both{DoubleTouchRules{}};
  (void)both.on_touch(touch_at(0.3, 0.005));
  (void)both.on_touch(touch_at(0.3, 0.001));
  ProbeTrigger other = touch_at(0.3, 0.001);
  other.velocity[2] = 0.001;
  EXPECT_EQ(both.on_touch(other)->error(), TouchRejection::OtherSide);
}

TEST(DoubleTouch, RefusesAFlaggedTouchAndBeginsWithTheNextFind) {
  DoubleTouch both{DoubleTouchRules{}};
  (void)both.on_touch(touch_at(0.3, 0.005));
  ProbeTrigger unsteady = touch_at(0.3, 0.001);
  unsteady.touch_flags |= TouchFlag::SpeedUnsteady;
  EXPECT_EQ(both.on_touch(unsteady)->error(), TouchRejection::NotUsable);
  (void)both.on_touch(touch_at(0.3, 0.005));
  (void)both.on_touch(touch_at(0.3, 0.001));
  EXPECT_TRUE(both.on_touch(touch_at(0.3, 0.001))->has_value());
}

TEST(DoubleTouch, DoesNotAverageAwayTheErrorOfTheDelay) {
  DoubleTouchRules rules;
  rules.slow_touches = 8;
  rules.u_repeatability_m = 0.0;
  rules.u_delay = 100us;
  DoubleTouch many{rules};
  (void)many.on_touch(touch_at(0.3, 0.005));
  std::optional<tl::expected<drivers::MeasuredTouch, TouchRejection>> point;

  for (int i = 0; i < 8; ++i) {
    ProbeTrigger t = touch_at(0.3, 0.001);
    t.u_position[2] = std::hypot(0.001 * 100e-6, 20e-9);
    point = many.on_touch(t);
  }

  ASSERT_TRUE(point && *point);
  EXPECT_NEAR((*point)->u_position[2], std::hypot(0.001 * 100e-6, 20e-9 / std::sqrt(8.0)), 1e-12);
}

}  // namespace
}  // namespace abbe::tests

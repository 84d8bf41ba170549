#include "abbe/calib/environment/sensor_check.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

#include "abbe/calib/environment/followed_value.hpp"

namespace abbe::calib {
namespace {

using namespace std::chrono_literals;
using std::chrono::nanoseconds;

constexpr double kIce = 273.15;

/// A sensor on a scale, read once a second.
class SensorCheck : public testing::Test {
 protected:
  SensorDoubt read(double temperature_C, nanoseconds after = 1s) {
    now_ += after;
    return check_reading(track_, limits_, temperature_C + kIce, now_).doubt;
  }
  void prove(double temperature_C) {
    (void)read(temperature_C);
    ASSERT_EQ(read(temperature_C), SensorDoubt::None);
  }
  /// Number of readings refused while the temperature follows `course` (of seconds).
  int refused(const std::function<double(double)>& course_C, int seconds) {
    int count = 0;
    for (int s = 1; s <= seconds; ++s) count += read(course_C(s)) == SensorDoubt::None ? 0 : 1;
    return count;
  }

  SensorLimits limits_{.lowest = 5 + kIce,
                       .highest = 50 + kIce,
                       .most_per_s = 2.0 / 60,
                       .tolerance = 0.5,
                       .celsius_power_on_values = true};
  SensorTrack track_;
  nanoseconds now_ = 1000s;
};

TEST_F(SensorCheck, UsesAReadingOnceASecondOneAgrees) {
  EXPECT_EQ(read(21.3), SensorDoubt::Unconfirmed);
  EXPECT_EQ(read(21.4), SensorDoubt::None);
}

TEST_F(SensorCheck, AWrongFirstReadingDoesNotDecideAboutTheNext) {
  EXPECT_EQ(read(35.0), SensorDoubt::Unconfirmed);
  EXPECT_EQ(read(21.3), SensorDoubt::Unconfirmed);
  EXPECT_EQ(read(21.3), SensorDoubt::None);
}

TEST_F(SensorCheck, RefusesWhatSensorsSendBeforeTheyMeasureAlsoWithinTheRange) {
  limits_.lowest = -150 + kIce;
  limits_.highest = 200 + kIce;
  for (const double value_C : {85.0, 127.0, -127.0, 0.0})
    for (int i = 0; i < 5; ++i) EXPECT_EQ(read(value_C), SensorDoubt::PowerOnValue) << value_C;
  EXPECT_EQ(read(85.1), SensorDoubt::Unconfirmed);
  EXPECT_EQ(read(85.0), SensorDoubt::PowerOnValue) << "not confirmed by it either";
}

TEST_F(SensorCheck, BelievesASensorThatRisesToAPowerOnValue) {
  limits_.highest = 200 + kIce;
  prove(84.5);
  EXPECT_EQ(refused([](double s) { return 84.5 + s / 60; }, 60), 0);
}

TEST_F(SensorCheck, RefusesWhatIsOutOfRangeWithoutAHistory) {
  for (const double value_C : {0.0, -40.0, 69.8, 85.0, 127.0})
    EXPECT_EQ(read(value_C), SensorDoubt::OutOfRange) << value_C;
}

TEST_F(SensorCheck, RefusesAJumpAndNamesWhatWasExpected) {
  prove(21.3);
  now_ += 1s;
  const auto jumped = check_reading(track_, limits_, 24.0 + kIce, now_);
  EXPECT_EQ(jumped.doubt, SensorDoubt::Jump);
  EXPECT_NEAR(jumped.lowest, 20.8 - 2.0 / 60 + kIce, 1e-9);
  EXPECT_NEAR(jumped.highest, 21.8 + 2.0 / 60 + kIce, 1e-9);
}

TEST_F(SensorCheck, DoesNotBelieveAJumpBecauseItLasts) {
  prove(21.3);
  EXPECT_EQ(refused([](double) { return 23.3; }, 12 * 3600), 12 * 3600);
  EXPECT_EQ(read(21.5), SensorDoubt::None) << "back where it was";
}

TEST_F(SensorCheck, RefusesARampOfSmallSteps) {
  prove(21.3);
  EXPECT_GT(refused([](double s) { return 21.3 + 0.2 * s; }, 60), 50);
}

TEST_F(SensorCheck, BelievesAMachineThatWarmsUp) {
  prove(18.0);
  const auto with_noise = [](double s) { return 18.0 + 20.0 * s / 3600 + 0.2 * std::sin(17 * s); };
  EXPECT_EQ(refused(with_noise, 3600), 0) << "20 K/h, four times a usual warm-up";
}

TEST_F(SensorCheck, BelievesTheAirWhenADoorIsOpened) {
  limits_.most_per_s = 10.0 / 60;
  prove(22.0);
  EXPECT_EQ(refused([](double s) { return 22.0 - 3.0 * s / 60; }, 240), 0);
}

TEST_F(SensorCheck, ASpikeCostsOneReading) {
  prove(21.3);
  EXPECT_EQ(read(44.0), SensorDoubt::Jump);
  EXPECT_EQ(read(21.3), SensorDoubt::None);
}

TEST_F(SensorCheck, AcceptsWhatCanHaveHappenedInAGap) {
  prove(21.3);
  EXPECT_EQ(read(25.0, 2min), SensorDoubt::None);
  EXPECT_EQ(read(31.0, 2min), SensorDoubt::Jump);
}

TEST_F(SensorCheck, BeginsAnewAfterALongGap) {
  prove(21.3);
  EXPECT_EQ(read(31.0, 11min), SensorDoubt::Unconfirmed);
  EXPECT_EQ(read(31.0), SensorDoubt::None);
}

TEST_F(SensorCheck, ReportsThatThereIsNoValue) {
  prove(21.3);
  EXPECT_EQ(read(std::nan("")), SensorDoubt::NoValue);
  EXPECT_EQ(read(21.4), SensorDoubt::None);
}

TEST(SensorTwins, DifferOnlyIfTwoComparisonsInARowSaySo) {
  int in_a_row = 0;
  EXPECT_FALSE(twins_differ(in_a_row, 21.0, 22.5, 1.0));
  EXPECT_FALSE(twins_differ(in_a_row, 21.0, 21.5, 1.0));
  EXPECT_FALSE(twins_differ(in_a_row, 21.0, 22.5, 1.0));
  EXPECT_TRUE(twins_differ(in_a_row, 21.0, 22.5, 1.0));
  EXPECT_FALSE(twins_differ(in_a_row, 21.0, 21.9, 1.0));
}

TEST(OtherSensors, DecideByTheirMedian) {
  const std::array others{20.0, 21.0, 44.0};
  EXPECT_FALSE(far_from_others(30.0, others, 15.0));
  EXPECT_TRUE(far_from_others(40.0, others, 15.0));
  EXPECT_FALSE(far_from_others(40.0, {}, 15.0));
}

TEST(HeldValue, IsUsedForItsTimeOnly) {
  HeldValue held;
  EXPECT_TRUE(std::isnan(held_value(held, {}, 100s, 60s))) << "nothing to hold";
  EXPECT_EQ(held_value(held, 21.0, 100s, 60s), 21.0);
  EXPECT_EQ(held_value(held, {}, 160s, 60s), 21.0);
  EXPECT_TRUE(std::isnan(held_value(held, {}, 161s, 60s)));
}

TEST(FollowedValue, MovesAtItsRateAndStopsAtTheTarget) {
  const FollowedValue from{20.0, 100s};
  EXPECT_DOUBLE_EQ(followed_value(from, 21.0, 100s, 0.1), 20.0);
  EXPECT_DOUBLE_EQ(followed_value(from, 21.0, 105s, 0.1), 20.5);
  EXPECT_DOUBLE_EQ(followed_value(from, 21.0, 200s, 0.1), 21.0);
  EXPECT_DOUBLE_EQ(followed_value(from, 19.0, 105s, 0.1), 19.5);
}

TEST(FollowedValue, BeginsAtItsFirstTargetAndFollowsNothingWithoutOne) {
  EXPECT_EQ(followed_value({}, 21.0, 100s, 0.1), 21.0);
  EXPECT_TRUE(std::isnan(followed_value({20.0, 100s}, std::nan(""), 101s, 0.1)));
}

}  // namespace
}  // namespace abbe::calib

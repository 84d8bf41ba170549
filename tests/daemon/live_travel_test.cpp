#include "abbe/pipeline/live_travel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <limits>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using calib::estimation::AxisTravel;
using calib::estimation::Travel;
using protocol::HostTime;

/// Readings of X every millisecond; Y and Z rest.
class LiveTravelOfX : public ::testing::Test {
 protected:
  Travel after(std::initializer_list<double> readings_um) {
    for (const double x_um : readings_um) take(1e-6 * x_um);
    return travel_.travel()[0];
  }
  void take(double x_m) {
    const std::array<double, 3> q{x_m, 0.2, -0.3};
    travel_.take(q, now_ += 1ms);
  }
  /// In steps of 0.1 mm.
  void drive(double from_m, double to_m) {
    const double step_m = std::copysign(1e-4, to_m - from_m);
    for (double x = from_m; std::abs(x - to_m) > 0.5e-4; x += step_m) take(x);
    take(to_m);
  }

  HostTime now_{100s};
  LiveTravel travel_{500ms};
};

TEST_F(LiveTravelOfX, IsUnknownBeforeTheFirstMotion) {
  EXPECT_EQ(after({0.0, 1.0, -1.0, 10.0}), Travel::Unknown);
  drive(0.0, 0.01);
  EXPECT_EQ(travel_.travel(), (AxisTravel{Travel::Forward, Travel::Unknown, Travel::Unknown}));
}

TEST_F(LiveTravelOfX, IsHeldWhileTheAxisRestsWithNoise) {
  drive(0.01, 0.0);
  EXPECT_EQ(after({0.5, -0.5, 2.0, -3.0, 20.0, 0.0}), Travel::Backward);
}

/// A control that applies V at the reversal moves the axis by the backlash, here 20 um.
TEST_F(LiveTravelOfX, DoesNotFollowTheStepOfItsOwnCorrection) {
  drive(0.0, 0.01);
  EXPECT_EQ(after({9970.0, 9949.0}), Travel::Backward);
  EXPECT_EQ(after({9969.0, 9949.0, 9969.0}), Travel::Backward);
}

TEST_F(LiveTravelOfX, TurnsAfterTheWidthOfThePlay) {
  drive(0.0, 0.01);
  const double turn_um = 1e6 * LiveTravel::kTurn_m;
  EXPECT_EQ(after({1e4 - turn_um + 1.0}), Travel::Forward);
  EXPECT_EQ(after({1e4 - turn_um - 1.0}), Travel::Backward);
}

TEST_F(LiveTravelOfX, IsUnknownAfterANewDatum) {
  drive(0.0, 0.01);
  take(0.12);
  EXPECT_EQ(travel_.travel()[0], Travel::Unknown);
  drive(0.12, 0.11);
  EXPECT_EQ(travel_.travel()[0], Travel::Backward);
}

TEST_F(LiveTravelOfX, IsUnknownAfterALongGapButNotAfterAShortOne) {
  drive(0.0, 0.01);
  now_ += 499ms;
  EXPECT_EQ(after({1e4}), Travel::Forward);
  now_ += 500ms;
  EXPECT_EQ(after({1e4}), Travel::Unknown);
}

TEST_F(LiveTravelOfX, IsUnknownWhileTheAxisIsNotReferenced) {
  drive(0.0, 0.01);
  EXPECT_EQ(after({std::numeric_limits<double>::quiet_NaN()}), Travel::Unknown);
  EXPECT_EQ(after({1e4, 1e4}), Travel::Unknown);
  drive(0.01, 0.011);
  EXPECT_EQ(travel_.travel()[0], Travel::Forward);
}

}  // namespace
}  // namespace abbe::daemon

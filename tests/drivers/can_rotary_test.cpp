/// The first count of a rotary axis, and the counts after which it wraps.

#include <gtest/gtest.h>

#include <initializer_list>
#include <numbers>
#include <optional>

#include "encoder_line.hpp"

namespace abbe::drivers {
namespace {

using namespace encoder_line;

constexpr double kTurn = 2 * std::numbers::pi;

/// Node 1 on a rotary axis, with a position of 32 bits.
EncoderAxis rotary_axis() {
  return {
      .name = "C", .node = 1, .kind = AxisKind::Rotary, .position = can::PositionType::Unsigned32};
}

EncoderReceiverOptions only(const EncoderAxis& axis) {
  EncoderReceiverOptions options;
  options.axes = {axis};
  return options;
}

/// Answers of node 1 to SDO requests.
const can::CanFrame kSingleTurnType =
    can::standard_frame(0x581, {0x43, 0x00, 0x10, 0, 0x96, 0x01, 0x01, 0});
const can::CanFrame kHundredCountsPerRevolution =
    can::standard_frame(0x581, {0x43, 0x01, 0x65, 0, 100, 0, 0, 0});
can::CanFrame revolutions(std::uint8_t number) {
  return can::standard_frame(0x581, {0x4B, 0x02, 0x65, 0, number, 0, 0, 0});
}

/// One cycle per count, a millisecond apart; returns the last sample.
protocol::AxisSample after(Line& line, std::initializer_list<std::int64_t> counts) {
  HostTime at = kStart;
  for (const std::int64_t count : counts) {
    line.sync(at);
    line.frame(can::encode_position(0x181, can::PositionType::Unsigned32, count), at + 10us);
    at += 1ms;
  }
  EXPECT_EQ(line.samples.size(), counts.size());
  return line.samples.back();
}

TEST(RotaryEncoder, IsUnwrappedAtTheConfiguredRange) {
  EncoderAxis axis = rotary_axis();
  axis.scale = kTurn / 36000;
  axis.wrap_counts = 36000;
  Line line{only(axis)};
  const auto last = after(line, {35990, 10, 17990, 35970, 5});
  EXPECT_EQ(line.samples.at(1).count[0], 36010);
  EXPECT_EQ(last.count[0], 72005);
  EXPECT_NEAR(last.position[0], kTurn * 72005 / 36000, 1e-12);
}

TEST(RotaryEncoder, WithoutScalingIsUnwrappedAtItsPhysicalRevolutions) {
  Line line{only(rotary_axis())};
  line.frame(kHundredCountsPerRevolution, kStart);
  line.frame(revolutions(2), kStart);
  const auto last = after(line, {190, 5});
  EXPECT_EQ(last.count[0], 205);
  EXPECT_NEAR(last.position[0], kTurn * 2.05, 1e-12);
}

TEST(RotaryEncoder, OfASingleTurnThatReportsNoRangeIsUnwrappedAtItsRevolution) {
  Line line{only(rotary_axis())};
  line.frame(kSingleTurnType, kStart);
  line.frame(kHundredCountsPerRevolution, kStart);
  EXPECT_EQ(after(line, {5, 90}).count[0], -10);
}

TEST(RotaryEncoder, BeginsInTheTravelOfItsAxis) {
  const auto first = [](std::optional<double> middle, double scale, std::int64_t count,
                        double offset = 0.0) {
    EncoderAxis axis = rotary_axis();
    axis.scale = scale;
    axis.offset = offset;
    axis.wrap_counts = 36000;
    axis.middle = middle;
    Line line{only(axis)};
    return after(line, {count}).position[0];
  };
  EXPECT_NEAR(first(0.0, kTurn / 36000, 35900), -kTurn / 360, 1e-12);
  EXPECT_NEAR(first(0.0, kTurn / 36000, 100), kTurn / 360, 1e-12);
  EXPECT_NEAR(first(0.0, -kTurn / 36000, 35900), kTurn / 360, 1e-12);
  EXPECT_NEAR(first(kTurn / 2, kTurn / 36000, 35900), kTurn * 359 / 360, 1e-12);
  EXPECT_NEAR(first(5 * kTurn, kTurn / 36000, 35900), kTurn * (5 - 1.0 / 360), 1e-12);
  EXPECT_NEAR(first(std::nullopt, kTurn / 36000, 35900), kTurn * 359 / 360, 1e-12);
  EXPECT_NEAR(first(0.0, kTurn / 36000, 35900, kTurn), -kTurn / 360, 1e-12);
  EXPECT_EQ(first(0.0, kTurn / 36000, 0, 1e300), 1e300) << "as sent";
}

TEST(RotaryEncoder, BeginsInTheTravelByTheRangeThatItReports) {
  EncoderAxis axis = rotary_axis();
  axis.scale = kTurn / 100;
  axis.middle = 0.0;
  Line line{only(axis)};
  line.frame(kHundredCountsPerRevolution, kStart);
  line.frame(revolutions(1), kStart);
  EXPECT_EQ(after(line, {90}).count[0], -10);
}

TEST(LinearEncoder, BeginsWithTheCountAsSentAlsoWithAMiddle) {
  EncoderAxis axis = rotary_axis();
  axis.kind = AxisKind::Linear;
  axis.scale = 1e-3;
  axis.wrap_counts = 1000;
  axis.middle = 0.0;
  Line line{only(axis)};
  EXPECT_EQ(after(line, {900}).count[0], 900);
}

}  // namespace
}  // namespace abbe::drivers

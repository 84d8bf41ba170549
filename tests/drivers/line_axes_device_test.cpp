// Positions of axes as lines of text.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "printed_axes.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using printed_axes::PrintedAxesOverTcp;
using protocol::AxisSample;
using protocol::SampleFlag;
using testing::HasSubstr;
using testing::IsEmpty;

PrintedAxesOverTcp with_time() {
  return {printed_axes::printing(line_sender::time_axes_status()), {}};
}

/// The time of a sample is known by its arrival, within 5 ms.
drivers::LineAxesOptions within_5_ms() {
  drivers::LineAxesOptions options;
  options.receiver.clock.max_constant_delay = 5ms;
  return options;
}

std::ptrdiff_t with_flag(const std::vector<AxisSample>& samples, SampleFlag flag) {
  return std::ranges::count_if(samples, [flag](const auto& s) { return has(s.head.flags, flag); });
}

TEST(LineAxes, GiveThePositionsOfTheMachine) {
  auto axes = with_time();
  axes.run_for(2s);
  ASSERT_GT(axes.samples.size(), 900u);
  constexpr double kTolerance_m = 6.0 * 5e-9;  // 6 standard deviations of the noise
  for (const AxisSample& sample : axes.samples) {
    EXPECT_EQ(sample.axis_count, 3);
    EXPECT_EQ(sample.missing_mask, 0);
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(sample.position[i], axes.machine.motion(axes.time.now()).q_m[i], kTolerance_m);
    EXPECT_EQ(sample.count[0], std::llround(sample.position[0] * 1e9));
  }
  EXPECT_EQ(axes.device->status().faults, 0u) << axes.device->status().last_fault;
}

TEST(LineAxes, SettleTheClockOfTheSender) {
  auto axes = with_time();
  axes.run_for(20s);
  EXPECT_TRUE(axes.device->status().clock.settled);
  EXPECT_EQ(axes.device->status().gaps, 0u);
}

TEST(LineAxes, AreDecodedFromTheirRawBytesToTheSameSamples) {
  auto axes = with_time();
  axes.run_for(1s);
  axes.inject(sim::FaultKind::TrackerGarbage);
  axes.run_for(1s);
  axes.inject(sim::FaultKind::Disconnect);
  axes.run_for(2s);
  const auto again = axes.decoded_again();
  ASSERT_EQ(again.size(), axes.samples.size());
  for (std::size_t i = 0; i < again.size(); ++i) {
    EXPECT_EQ(again[i].head.time, axes.samples[i].head.time);
    EXPECT_EQ(again[i].head.u_time, axes.samples[i].head.u_time);
    EXPECT_EQ(again[i].head.flags, axes.samples[i].head.flags);
    EXPECT_EQ(again[i].position, axes.samples[i].position);
    EXPECT_EQ(again[i].cycle, axes.samples[i].cycle);
  }
}

TEST(LineAxes, AreMissingWhileTheStatusIsInvalid) {
  auto axes = with_time();
  axes.run_for(1s);
  EXPECT_EQ(with_flag(axes.samples, SampleFlag::AxisMissing), 0);
  axes.inject(sim::FaultKind::PrismError, 0.5);
  axes.run_for(300ms);
  EXPECT_THAT(axes.device->status().condition, HasSubstr("status column"));
  axes.run_for(1s);
  EXPECT_NEAR(static_cast<double>(with_flag(axes.samples, SampleFlag::AxisMissing)), 250.0, 2.0);
  EXPECT_THAT(axes.device->status().condition, IsEmpty());
}

TEST(LineAxes, ReportAnUnreadableLineWithItsColumn) {
  auto axes = with_time();
  axes.run_for(1s);
  axes.inject(sim::FaultKind::TrackerGarbage);
  axes.run_for(1s);
  EXPECT_THAT(axes.device->status().last_fault, HasSubstr("column 1 (time): not a number"));
  EXPECT_EQ(with_flag(axes.samples, SampleFlag::GapBefore), 1);
}

TEST(LineAxes, MarkTheGapOfLinesThatWereNotSent) {
  auto axes = with_time();
  axes.run_for(1s);
  axes.inject(sim::FaultKind::Mute, 0.1);
  axes.run_for(1s);
  EXPECT_EQ(axes.device->status().gaps, 1u);
  const auto gap = std::ranges::find_if(
      axes.samples, [](const auto& s) { return has(s.head.flags, SampleFlag::GapBefore); });
  ASSERT_NE(gap, axes.samples.end());
  EXPECT_NEAR(static_cast<double>(gap->head.lost_before), 50.0, 1.0);
}

TEST(LineAxes, ReportAnotherRateThanConfigured) {
  drivers::LineAxesOptions options;
  options.receiver.time_separation = 10ms;
  PrintedAxesOverTcp axes{printed_axes::printing(line_sender::time_axes_status()), options};
  axes.run_for(2s);
  EXPECT_THAT(axes.device->status().last_fault, HasSubstr("set sample_rate_hz = 500"));
}

TEST(LineAxesByArrival, HaveTheMiddleOfTheLatencyAndItsUncertainty) {
  PrintedAxesOverTcp axes{printed_axes::printing(printed_axes::axes_alone()), within_5_ms()};
  axes.run_for(1s);
  ASSERT_GT(axes.samples.size(), 400u);
  EXPECT_EQ(axes.device->status().gaps, 0u);
  for (std::size_t i = 0; i < axes.samples.size(); ++i) {
    const auto& head = axes.samples[i].head;
    EXPECT_NEAR(static_cast<double>(head.u_time.count()), 5e6 / std::sqrt(12.0), 1.0);
    EXPECT_FALSE(has(head.flags, SampleFlag::ClockUnsettled));
    if (i > 0) {
      EXPECT_GT(head.time, axes.samples[i - 1].head.time);
    }
  }
}

TEST(LineAxesByArrival, UseTheNewestOfLinesThatComeTogether) {
  auto printed = printed_axes::printing(printed_axes::axes_alone());
  printed.times.bursts = true;
  PrintedAxesOverTcp axes{printed, within_5_ms()};
  axes.run_for(3s);
  EXPECT_NEAR(static_cast<double>(axes.samples.size()), 3.0 / 0.332, 1.0);
  EXPECT_THAT(axes.device->status().condition, HasSubstr("several lines come together"));
}

TEST(LineAxesByArrival, MarkTheGapOfAStalledSender) {
  PrintedAxesOverTcp axes{printed_axes::printing(printed_axes::axes_alone()), within_5_ms()};
  axes.run_for(1s);
  axes.inject(sim::FaultKind::Mute, 0.1);
  axes.run_for(500ms);
  EXPECT_EQ(axes.device->status().gaps, 1u);
  const auto again = axes.decoded_again();
  ASSERT_EQ(again.size(), axes.samples.size());
  EXPECT_EQ(again.back().head.time, axes.samples.back().head.time);
}

TEST(LineAxesDevice, RefusesAFormatWithoutAPosition) {
  SteppedTime time;
  drivers::LineAxesOptions options;
  options.address = drivers::LineTcp{"127.0.0.1", 7001};
  const auto device = drivers::LineAxesDevice::create(options, time);
  ASSERT_FALSE(device);
  EXPECT_EQ(device.error().code, drivers::ErrorCode::BadConfiguration);
}

}  // namespace
}  // namespace abbe::tests

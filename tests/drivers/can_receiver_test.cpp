#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "abbe/protocol/can/error_frame.hpp"
#include "encoder_line.hpp"

namespace abbe::drivers {
namespace {

using namespace encoder_line;
using can::BusCondition;
using protocol::RawBlock;
using protocol::SampleFlag;

can::CanFrame bus_report(BusCondition condition) {
  return can::encode_error_frame({.conditions = static_cast<can::BusConditions>(condition)});
}

TEST(EncoderReceiver, DatesAllAxesByTheSync) {
  auto options = three_axes();
  options.sampling_delay = 7us;
  Line line{options};
  line.cycle(kStart, 1000);
  ASSERT_EQ(line.samples.size(), 1u);
  EXPECT_EQ(line.samples[0].head.time, kStart + 7us);
  EXPECT_EQ(line.samples[0].head.u_time, options.u_sampling_delay);
  EXPECT_EQ(line.samples[0].head.flags, 0u);
  EXPECT_EQ(line.samples[0].axis_count, 3);
  EXPECT_EQ(line.samples[0].missing_mask, 0);
}

TEST(EncoderReceiver, ConvertsCountsByTheScaleOfEachAxis) {
  auto options = three_axes();
  options.axes[1].scale = -2e-9;
  Line line{options};
  line.cycle(kStart, 1000);
  EXPECT_DOUBLE_EQ(line.samples.at(0).position[0], 1000 * 1e-8);
  EXPECT_DOUBLE_EQ(line.samples.at(0).position[1], 1001 * -2e-9);
  EXPECT_EQ(line.samples.at(0).count[2], 1002);
}

TEST(EncoderReceiver, AddsTheReadingAtCountZero) {
  auto options = three_axes();
  options.axes[0].offset = -0.25;
  Line line{options};
  line.cycle(kStart, 1000);
  EXPECT_DOUBLE_EQ(line.samples.at(0).position[0], -0.25 + 1000 * 1e-8);
  EXPECT_DOUBLE_EQ(line.samples.at(0).position[1], 1001 * 1e-8);
}

TEST(EncoderReceiver, GivesTheSampleWithTheLastAnswerAndNotBefore) {
  Line line;
  line.sync(kStart);
  line.frame(position(3, 3), kStart + 100us);
  line.frame(position(1, 1), kStart + 200us);
  EXPECT_TRUE(line.samples.empty());
  line.frame(position(2, 2), kStart + 300us);
  EXPECT_EQ(line.samples.size(), 1u);
  EXPECT_EQ(line.receiver.deadline(), HostTime::max());
}

TEST(EncoderReceiver, FlagsAMissingAxisAtTheDeadlineAndKeepsItsValue) {
  Line line;
  line.cycle(kStart, 1000);
  line.sync(kStart + 1ms);
  line.frame(position(1, 2000), kStart + 1100us);
  line.frame(position(3, 2002), kStart + 1200us);
  line.time(kStart + 1799us);

  EXPECT_EQ(line.samples.size(), 1u);
  line.time(kStart + 1800us);
  ASSERT_EQ(line.samples.size(), 2u);
  EXPECT_EQ(line.samples[1].missing_mask, 0b010);
  EXPECT_TRUE(has(line.samples[1].head.flags, SampleFlag::AxisMissing));
  EXPECT_EQ(line.samples[1].count[1], 1001);
  EXPECT_EQ(line.samples[1].count[2], 2002);
  EXPECT_EQ(line.receiver.counters().missing_answers, 1u);
}

TEST(EncoderReceiver, ClosesAnOpenCycleWithTheNextSync) {
  Line line;
  line.sync(kStart);
  line.sync(kStart + 1ms);
  ASSERT_EQ(line.samples.size(), 1u);
  EXPECT_EQ(line.samples[0].head.time, kStart);
  EXPECT_EQ(line.samples[0].missing_mask, 0b111);
}

TEST(EncoderReceiver, AFrameAfterTheDeadlineClosesTheCycleAndIsNotUsed) {
  Line line;
  line.cycle(kStart, 1000);
  line.sync(kStart + 1ms);
  line.frame(position(1, 5000), kStart + 1ms + 800us);
  ASSERT_EQ(line.samples.size(), 2u);
  EXPECT_EQ(line.samples[1].missing_mask, 0b111);
  EXPECT_EQ(line.samples[1].count[0], 1000);
  EXPECT_EQ(line.receiver.counters().late_frames, 1u);
}

TEST(EncoderReceiver, AnAxisThatNeverAnsweredHasNoPosition) {
  Line line;
  line.sync(kStart);
  line.frame(position(1, 7), kStart + 100us);
  line.time(kStart + 900us);
  ASSERT_EQ(line.samples.size(), 1u);
  EXPECT_FALSE(std::isnan(line.samples[0].position[0]));
  EXPECT_TRUE(std::isnan(line.samples[0].position[1]));
}

TEST(EncoderReceiver, UnwrapsThirtyTwoBitsInBothDirections) {
  Line line;
  line.cycle(kStart, 2147483640);
  line.cycle(kStart + 1ms, -2147483640);
  line.cycle(kStart + 2ms, 2147483640);
  EXPECT_EQ(line.samples.at(1).count[0], 2147483656);
  EXPECT_EQ(line.samples.at(2).count[0], 2147483640);
}

TEST(EncoderReceiver, TakesTheFirstCountOfAnAbsoluteScaleAsItIs) {
  Line line;
  line.cycle(kStart, -5000);
  EXPECT_EQ(line.samples.at(0).count[0], -5000);
  EXPECT_DOUBLE_EQ(line.samples.at(0).position[0], -5e-5);
}

TEST(EncoderReceiver, ReadsSixtyFourBitPositions) {
  auto options = three_axes();
  for (auto& axis : options.axes) axis.position = can::PositionType::Signed64;
  Line line{options};
  line.sync(kStart);
  for (const can::NodeId node : kNodes) {
    line.frame(can::encode_position(0x180u + node, can::PositionType::Signed64, -10'000'000'000),
               kStart + 10us);
  }
  EXPECT_EQ(line.samples.at(0).count[2], -10'000'000'000);
}

TEST(EncoderReceiver, ReadsTheStepFromTheBus) {
  Line line{three_axes(std::nullopt)};
  for (const can::NodeId node : kNodes) {
    EXPECT_FALSE(line.receiver.scale(node - 1u));
    line.frame(can::standard_frame(0x580u + node, {0x43, 0x05, 0x60, 0x01, 25, 0, 0, 0}), kStart);
  }
  line.cycle(kStart, 1000);
  EXPECT_DOUBLE_EQ(*line.receiver.scale(0), 25e-9);
  EXPECT_DOUBLE_EQ(line.samples.at(0).position[0], 25e-6);
}

TEST(EncoderReceiver, RefusesAStepOfZeroAndKeepsTheAxisMissing) {
  Line line{three_axes(std::nullopt)};
  for (const can::NodeId node : kNodes) {
    line.frame(can::standard_frame(0x580u + node, {0x43, 0x05, 0x60, 0x01, 0, 0, 0, 0}), kStart);
  }
  line.cycle(kStart, 1000);
  EXPECT_EQ(line.samples.at(0).missing_mask, 0b111);
  EXPECT_TRUE(std::isnan(line.samples.at(0).position[0]));
  EXPECT_EQ(line.receiver.counters().scale_refusals, 3u);
}

TEST(EncoderReceiver, TheConfiguredScaleOverridesTheEncoders) {
  Line line;
  line.frame(can::standard_frame(0x581, {0x43, 0x05, 0x60, 0x01, 25, 0, 0, 0}), kStart);
  EXPECT_DOUBLE_EQ(*line.receiver.scale(0), 1e-8);
}

TEST(EncoderReceiver, AnEmergencyStaysUntilTheNodeClearsIt) {
  Line line;
  line.frame(can::encode_emergency({.node = 2, .code = 0x5000, .error_register = 1}), kStart);
  line.cycle(kStart, 1);
  line.cycle(kStart + 1ms, 2);
  EXPECT_TRUE(has(line.samples.at(0).head.flags, SampleFlag::DeviceError));
  EXPECT_TRUE(has(line.samples.at(1).head.flags, SampleFlag::DeviceError));
  line.frame(can::encode_emergency({.node = 2}), kStart + 1500us);
  line.cycle(kStart + 2ms, 3);
  EXPECT_EQ(line.samples.at(2).head.flags, 0u);
  EXPECT_EQ(line.receiver.counters().emergencies, 1u);
}

TEST(EncoderReceiver, ReportsAHeartbeatThatStopped) {
  Line line;
  line.frame(can::encode_heartbeat(1, can::NodeState::Operational), kStart);
  line.cycle(kStart + 350ms, 1);
  EXPECT_EQ(
      line.samples.at(0).head.flags & static_cast<protocol::SampleFlags>(SampleFlag::DeviceError),
      0u);
  line.cycle(kStart + 351ms, 2);
  EXPECT_TRUE(has(line.samples.at(1).head.flags, SampleFlag::DeviceError));
  EXPECT_EQ(line.receiver.counters().heartbeat_losses, 1u);
  line.frame(can::encode_heartbeat(1, can::NodeState::Operational), kStart + 351500us);
  line.cycle(kStart + 352ms, 3);
  EXPECT_FALSE(has(line.samples.at(2).head.flags, SampleFlag::DeviceError));
}

TEST(EncoderReceiver, MarksTheSampleAfterABusErrorOnly) {
  Line line;
  line.frame(bus_report(BusCondition::NoAcknowledge), kStart);
  line.cycle(kStart, 1);
  line.cycle(kStart + 1ms, 2);
  EXPECT_TRUE(has(line.samples.at(0).head.flags, SampleFlag::BusError));
  EXPECT_FALSE(has(line.samples.at(1).head.flags, SampleFlag::BusError));
}

TEST(EncoderReceiver, AnOverflowOfTheControllerIsALoss) {
  Line line;
  line.cycle(kStart, 1000);
  line.sync(kStart + 1ms);
  line.frame(position(1, 2000), kStart + 1100us);
  line.frame(bus_report(BusCondition::ReceiveOverflow), kStart + 1200us);
  line.frame(position(2, 2001), kStart + 1300us);
  line.cycle(kStart + 2ms, 3000);
  line.finish();
  ASSERT_EQ(line.samples.size(), 3u);
  EXPECT_EQ(line.samples[1].missing_mask, 0b110);
  EXPECT_EQ(line.samples[2].missing_mask, 0);
  EXPECT_TRUE(has(line.samples[2].head.flags, SampleFlag::GapBefore));
}

TEST(EncoderReceiver, ReadsWhereAFixedMappingHasThePosition) {
  Line line;
  for (const can::NodeId node : kNodes) {
    line.frame(can::standard_frame(0x580u + node, {0x4F, 0x00, 0x1A, 0, 2, 0, 0, 0}), kStart);
    line.frame(can::standard_frame(0x580u + node, {0x43, 0x00, 0x1A, 1, 0x10, 1, 0x30, 0x60}),
               kStart);
    line.frame(can::standard_frame(0x580u + node, {0x43, 0x00, 0x1A, 2, 0x20, 0, 0x04, 0x60}),
               kStart);
  }

  line.sync(kStart);
  for (const can::NodeId node : kNodes)
    line.frame(can::standard_frame(0x180u + node, {9, 9, 0xE8, 3, 0, 0}), kStart + 100us);
  ASSERT_EQ(line.samples.size(), 1u);
  EXPECT_EQ(line.samples[0].count[2], 1000);
}

TEST(EncoderReceiver, WaitsForAHeartbeatAsLongAsItsNodeStates) {
  Line line;
  line.frame(can::standard_frame(0x581, {0x4B, 0x17, 0x10, 0, 0xE8, 3, 0, 0}), kStart);  // 1000 ms
  line.frame(can::encode_heartbeat(1, can::NodeState::Operational), kStart);
  line.cycle(kStart + 2s, 1);
  EXPECT_FALSE(has(line.samples.back().head.flags, SampleFlag::DeviceError));
  line.cycle(kStart + 4s, 2);
  line.finish();
  EXPECT_TRUE(has(line.samples.back().head.flags, SampleFlag::DeviceError));
}

TEST(EncoderReceiver, BusOffMakesAllAxesInvalidAtOnce) {
  Line line;
  line.cycle(kStart, 1000);
  line.sync(kStart + 1ms);
  line.frame(position(1, 2000), kStart + 1100us);
  line.frame(bus_report(BusCondition::BusOff), kStart + 1200us);
  ASSERT_EQ(line.samples.size(), 2u);
  EXPECT_EQ(line.samples[1].missing_mask, 0b111);
  EXPECT_TRUE(has(line.samples[1].head.flags, SampleFlag::BusOff));
  EXPECT_TRUE(line.receiver.bus_off());
}

TEST(EncoderReceiver, ComesBackFromBusOffWithARestartedSample) {
  for (const bool told : {true, false}) {
    Line line;
    line.cycle(kStart, 1000);
    line.frame(bus_report(BusCondition::BusOff), kStart + 900us);
    if (told) line.frame(bus_report(BusCondition::Restarted), kStart + 100ms);
    line.cycle(kStart + 101ms, 3000);
    line.finish();
    const auto& sample = line.samples.back();
    EXPECT_EQ(sample.missing_mask, 0);
    EXPECT_FALSE(has(sample.head.flags, SampleFlag::BusOff));
    EXPECT_TRUE(has(sample.head.flags, SampleFlag::Restarted));
    EXPECT_TRUE(has(sample.head.flags, SampleFlag::GapBefore));
  }
}

TEST(EncoderReceiver, ABootUpMarksTheNextSampleRestarted) {
  Line line;
  line.cycle(kStart, 1);
  line.frame(can::encode_heartbeat(2, can::NodeState::BootUp), kStart + 900us);
  line.cycle(kStart + 1ms, 2);
  line.cycle(kStart + 2ms, 3);
  EXPECT_TRUE(has(line.samples.at(1).head.flags, SampleFlag::Restarted));
  EXPECT_FALSE(has(line.samples.at(2).head.flags, SampleFlag::Restarted));
}

TEST(EncoderReceiver, ALossEndsTheOpenCycleAndMarksTheNextSample) {
  Line line;
  line.cycle(kStart, 1000);
  line.sync(kStart + 1ms);
  line.frame(position(kNodes[0], 2000), kStart + 1100us);

  // Lost here: the other answers, a SYNC, and the first answer to it.
  line.keep(line.receiver.on_loss());
  ASSERT_EQ(line.samples.size(), 2u);
  EXPECT_EQ(line.samples.back().missing_mask, 0b110);
  line.frame(position(kNodes[1], 3000), kStart + 2200us);
  EXPECT_EQ(line.samples.size(), 2u) << "an answer to a SYNC nobody knows";
  line.cycle(kStart + 3ms, 4000);
  line.finish();
  ASSERT_EQ(line.samples.size(), 3u);
  EXPECT_EQ(line.samples.back().missing_mask, 0);
  EXPECT_TRUE(has(line.samples.back().head.flags, SampleFlag::GapBefore));
}

TEST(EncoderReceiver, CountsTheLossReportedByARawBlock) {
  EncoderReceiver receiver{three_axes()};
  std::vector<AxisSample> samples;
  const auto keep = [&](const AxisSample& s) { samples.push_back(s); };
  RawBlock block;
  block.time = kStart;
  block.direction = RawBlock::Direction::ToDevice;
  can::DatagramWriter sync{block.bytes, 0};

  ASSERT_TRUE(sync.add(can::encode_sync()));
  block.length = static_cast<std::uint16_t>(sync.finish().size());
  receiver.on_raw(block, keep);
  EXPECT_TRUE(samples.empty());
  RawBlock later;
  later.time = kStart + 100us;
  later.length = 0;
  later.lost_before = 1;
  receiver.on_raw(later, keep);
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_EQ(samples[0].missing_mask, 0b111);
}

TEST(EncoderReceiver, FlagsAndWidensACycleWithAnAnswerOfUnknownTime) {
  Line line;
  line.sync(kStart);
  line.frame(position(kNodes[0], 1), kStart + 100us);
  line.keep(line.receiver.on_frame(position(kNodes[1], 2), kStart + 200us, true));
  line.frame(position(kNodes[2], 3), kStart + 300us);
  line.cycle(kStart + 1ms, 10);

  ASSERT_EQ(line.samples.size(), 2u);
  EXPECT_TRUE(has(line.samples[0].head.flags, SampleFlag::TimeWidened));
  EXPECT_NEAR(static_cast<double>(line.samples[0].head.u_time.count()),
              std::hypot(static_cast<double>(line.samples[1].head.u_time.count()),
                         1e6 / std::numbers::sqrt3),
              1.0);
  EXPECT_FALSE(has(line.samples[1].head.flags, SampleFlag::TimeWidened));
}

TEST(EncoderReceiver, FlagsAndWidensACycleWithASyncOfUnknownTime) {
  Line line;
  line.keep(line.receiver.on_sent(can::encode_sync(), kStart, true));
  for (const can::NodeId node : kNodes) line.frame(position(node, 1), kStart + 100us);
  line.cycle(kStart + 1ms, 10);
  ASSERT_EQ(line.samples.size(), 2u);
  EXPECT_TRUE(has(line.samples[0].head.flags, SampleFlag::TimeWidened));
  EXPECT_GT(line.samples[0].head.u_time, line.samples[1].head.u_time);
  EXPECT_FALSE(has(line.samples[1].head.flags, SampleFlag::TimeWidened));
}

TEST(EncoderReceiver, CountsPeriodsWithoutASync) {
  Line line;
  line.cycle(kStart, 1);
  line.cycle(kStart + 4ms + 30us, 2);
  line.finish();
  EXPECT_TRUE(has(line.samples.at(1).head.flags, SampleFlag::GapBefore));
  EXPECT_EQ(line.samples.at(1).head.lost_before, 3u);
  EXPECT_EQ(line.receiver.counters().missed_syncs, 3u);
}

TEST(EncoderReceiver, CountsTpdosTooShortForAPosition) {
  Line line;
  line.sync(kStart);
  line.frame(can::standard_frame(0x181, {1, 2}), kStart + 10us);
  line.time(kStart + 900us);
  EXPECT_EQ(line.receiver.counters().short_frames, 1u);
  EXPECT_EQ(line.samples.at(0).missing_mask, 0b111);
}

TEST(EncoderReceiver, IgnoresFramesOfOtherNodes) {
  Line line;
  line.sync(kStart);
  for (const std::uint32_t id : {0x000u, 0x080u, 0x184u, 0x281u, 0x601u, 0x7FFu}) {
    line.frame(can::standard_frame(id, {1, 2, 3, 4, 5, 6, 7, 8}), kStart + 10us);
  }
  auto extended = position(1, 5);
  extended.set(can::FrameFlag::Extended);
  line.frame(extended, kStart + 10us);
  line.time(kStart + 900us);
  EXPECT_EQ(line.samples.at(0).missing_mask, 0b111);
}

TEST(EncoderReceiver, TakesPositionsFromCanFdFramesToo) {
  Line line;
  line.sync(kStart);
  for (const can::NodeId node : kNodes) {
    auto frame = position(node, 9);
    frame.set(can::FrameFlag::Fd);
    line.frame(frame, kStart + 10us);
  }
  EXPECT_EQ(line.samples.at(0).missing_mask, 0);
}

TEST(EncoderOptions, AreRefusedWithTheNameOfTheAxis) {
  const auto refused = [](auto&& change) {
    auto options = three_axes();
    change(options);
    const auto result = check(options);
    return result ? std::string{} : result.error().text;
  };

  EXPECT_TRUE(check(three_axes()));
  EXPECT_THAT(refused([](auto& o) { o.axes[1].scale = 0.0; }), testing::HasSubstr("XYZ2"));
  EXPECT_THAT(refused([](auto& o) { o.axes[2].node = 1; }), testing::HasSubstr("both are node 1"));
  EXPECT_THAT(refused([](auto& o) { o.axes[0].node = 128; }), testing::HasSubstr("1 to 127"));
  EXPECT_THAT(refused([](auto& o) { o.axes.resize(9); }), testing::HasSubstr("9 axes"));
  EXPECT_THAT(refused([](auto& o) { o.axes.clear(); }), testing::HasSubstr("0 axes"));
  EXPECT_THAT(refused([](auto& o) { o.sync_period = 0ns; }), testing::HasSubstr("period"));
  EXPECT_THAT(refused([](auto& o) { o.answer_within = 2ms; }), testing::HasSubstr("answers"));
}

}  // namespace
}  // namespace abbe::drivers

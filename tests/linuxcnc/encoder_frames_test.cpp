// SPDX-License-Identifier: GPL-2.0-or-later
// Scale readings of LinuxCNC as CANopen frames (linuxcnc/encoder).
#include "encoder_frames.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "abbe/drivers/can/emergency_reports.hpp"
#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/pdo.hpp"
#include "abbe/protocol/can/udp_framing.hpp"

namespace {

using abbe::linuxcnc::causes_of;
using abbe::linuxcnc::Decimation;
using abbe::linuxcnc::describe;
using abbe::linuxcnc::Emergencies;
using abbe::linuxcnc::EmergencySchedule;
using abbe::linuxcnc::encoder_datagram;
using abbe::linuxcnc::EncoderBusOptions;
using abbe::linuxcnc::ServoSample;
namespace can = abbe::protocol::can;

ServoSample sample_at(double x_mm, double y_mm, double z_mm) {
  ServoSample sample;
  sample.offset_mm = {0.0, -3.0, 200.0};
  sample.motor_mm = {x_mm, y_mm - 3.0, z_mm + 200.0};
  sample.homed = true;
  return sample;
}

/// Positions in mm by node, as abbed decodes them; the first frame must be the SYNC.
std::map<std::uint32_t, double> decoded_mm(const ServoSample& sample) {
  const EncoderBusOptions options;
  const auto bytes = encoder_datagram(sample, 7, options, Emergencies::Omitted);
  auto view = can::DatagramView::parse(bytes);
  EXPECT_TRUE(view);
  EXPECT_EQ(view->sequence(), 7);
  can::CanFrame frame;
  EXPECT_TRUE(view->next(frame));
  EXPECT_EQ(frame.id, can::cob::kSync);
  EXPECT_EQ(frame.length, 0);

  std::map<std::uint32_t, double> positions_mm;
  while (view->next(frame)) {
    const auto count = can::decode_position(frame.payload(), can::PositionType::Signed32);
    EXPECT_TRUE(count);
    positions_mm[frame.id - can::cob::kTpdo1] = static_cast<double>(*count) * options.step_mm;
  }
  return positions_mm;
}

TEST(EncoderFrames, CarryTheReadingOfEveryJointToHalfAStep) {
  const auto mm = decoded_mm(sample_at(-250.123456, 0.0, -350.000004));
  ASSERT_EQ(mm.size(), 3u);
  const double half_step_mm = 0.5 * EncoderBusOptions{}.step_mm + 1e-9;
  EXPECT_NEAR(mm.at(1), -250.123456, half_step_mm);
  EXPECT_NEAR(mm.at(2), 0.0, half_step_mm);
  EXPECT_NEAR(mm.at(3), -350.000004, half_step_mm);
}

TEST(EncoderFrames, BeforeHomingThereIsOnlyTheSync) {
  ServoSample sample = sample_at(1, 2, 3);
  sample.homed = false;
  EXPECT_TRUE(decoded_mm(sample).empty());
}

TEST(EncoderFrames, AReadingThatCannotBeEncodedIsMissing) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double bad_mm : {nan, infinity, -infinity, 1e9}) {
    const auto mm = decoded_mm(sample_at(1.0, bad_mm, 3.0));
    EXPECT_EQ(mm.size(), 2u) << bad_mm;
    EXPECT_FALSE(mm.contains(2)) << bad_mm;
  }
}

/// What `abbe status` shows of the axes after `emergencies` has received `sample` at `at`.
std::string condition_after(const ServoSample& sample, abbe::drivers::EmergencyReports& emergencies,
                            abbe::protocol::HostTime at) {
  const auto bytes = encoder_datagram(sample, 0, {}, Emergencies::Included);
  auto view = can::DatagramView::parse(bytes);
  EXPECT_TRUE(view);
  unsigned absent = 0b111;
  can::CanFrame frame;
  while (view->next(frame)) {
    emergencies.on_frame(frame, at);
    if (can::cob::is_tpdo(frame)) absent &= ~(1u << (frame.id - can::cob::kTpdo1 - 1));
  }
  return emergencies.condition(static_cast<std::uint8_t>(absent), at);
}

TEST(EncoderFrames, ReportThatTheControlIsNotHomed) {
  const std::vector<abbe::drivers::EncoderAxis> axes{
      {.name = "X", .node = 1}, {.name = "Y", .node = 2}, {.name = "Z", .node = 3}};
  abbe::drivers::EmergencyReports emergencies(axes);
  abbe::protocol::HostTime at{std::chrono::seconds{1}};
  ServoSample sample = sample_at(1, 2, 3);
  sample.homed = false;
  EXPECT_EQ(condition_after(sample, emergencies, at),
            "X missing (node 1): LinuxCNC is not homed; Y missing (node 2): LinuxCNC is not "
            "homed; Z missing (node 3): LinuxCNC is not homed");
  EXPECT_EQ(emergencies.take_fault(at), "encoder X (node 1): LinuxCNC is not homed");

  EXPECT_EQ(condition_after(sample_at(1, 2, 3), emergencies, at), "");
  sample = sample_at(1, 1e9, 3);
  EXPECT_EQ(condition_after(sample, emergencies, at),
            "Y missing (node 2): LinuxCNC reports no position that can be sent");
}

TEST(EmergencySchedule, ReportsAChangeAtOnceAndRepeatsItEverySecond) {
  ServoSample homed = sample_at(1, 2, 3), not_homed = homed;
  not_homed.homed = false;
  EmergencySchedule schedule;
  std::vector<std::uint32_t> included;
  for (std::uint32_t n = 0; n < 5000; n += 5) {
    const auto causes = causes_of(n < 2500 ? not_homed : homed, {});
    // The number of a cycle wraps at 2^32: here at n = 1000.
    if (schedule.choose(n - 1000, causes) == Emergencies::Included) included.push_back(n);
  }
  EXPECT_EQ(included, (std::vector<std::uint32_t>{0, 1000, 2000, 2500, 3500, 4500}));
}

TEST(DescriptionOfCauses, NamesTheControlOrTheJoints) {
  ServoSample sample = sample_at(1, 2, 3);
  EXPECT_EQ(describe(causes_of(sample, {})), "LinuxCNC is homed: abbed receives its positions");
  sample.motor_mm[2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(describe(causes_of(sample, {})),
            "joint 2: LinuxCNC reports no position that can be sent");
  sample.homed = false;
  EXPECT_EQ(describe(causes_of(sample, {})), "LinuxCNC is not homed: abbed receives no positions");
}

TEST(PositionRecordOfASample, HasTheReadingOfEachJoint) {
  ServoSample sample = sample_at(1.5, -2.0, -100.0);
  sample.number = 4711;
  const auto record = abbe::linuxcnc::position_record(sample, 1'000'000);
  EXPECT_TRUE(record.homed);
  EXPECT_EQ(record.cycle, 4711u);
  EXPECT_EQ(record.period_ns, 1'000'000u);
  for (std::size_t joint = 0; joint < 3; ++joint)
    EXPECT_NEAR(record.position_m[joint], 1e-3 * sample.reading_mm(joint), 1e-15);
  EXPECT_NEAR(record.position_m[2], -0.1, 1e-12);
  EXPECT_EQ(abbe::protocol::decode_position_record(abbe::protocol::encode(record)), record);
}

TEST(PositionRecordOfASample, WithoutAReadingIsNotHomed) {
  ServoSample sample = sample_at(1.0, 2.0, 3.0);
  sample.homed = false;
  EXPECT_FALSE(abbe::linuxcnc::position_record(sample, 1'000'000).homed);
  const auto record = abbe::linuxcnc::position_record(
      sample_at(1.0, std::numeric_limits<double>::quiet_NaN(), 3.0), 1'000'000);
  EXPECT_FALSE(record.homed);
  EXPECT_TRUE(abbe::protocol::decode_position_record(abbe::protocol::encode(record)));
}

TEST(Decimation, SendsEveryNthSampleAndNeverALateOne) {
  Decimation decimation(5);
  int sent = 0;
  for (std::uint32_t n = 1; n <= 100; ++n) {
    ServoSample sample;
    sample.number = n;
    if (const auto due = decimation.choose({&sample, 1})) {
      EXPECT_EQ(due->number % 5, 0u);
      ++sent;
    }
  }
  EXPECT_EQ(sent, 20);
  EXPECT_EQ(decimation.late(), 0u);

  std::vector<ServoSample> together(12);  // read together after a pause: 100 to 111
  for (std::uint32_t i = 0; i < 12; ++i) together[i].number = 100 + i;
  EXPECT_FALSE(decimation.choose(together));
  EXPECT_EQ(decimation.late(), 3u);  // 100, 105, 110
  together.resize(11);
  const auto newest = decimation.choose(together);
  ASSERT_TRUE(newest);
  EXPECT_EQ(newest->number, 110u);
}

}  // namespace

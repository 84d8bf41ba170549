#include "abbe/drivers/lines/device.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <vector>

#include "abbe/sim/line_tracker_server.hpp"
#include "line_peer.hpp"
#include "stepped_time.hpp"
#include "tracker_peer.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// A device that reads what a simulated tracker prints, over TCP.
class LineTrackerOverTcp : public testing::Test {
 protected:
  static sim::LineTrackerOptions tracker_options() {
    sim::LineTrackerOptions options;
    options.format = line_sender::time_x_y_z_status();
    return options;
  }
  drivers::LineTrackerOptions options() {
    drivers::LineTrackerOptions options;
    options.address = drivers::LineTcp{"127.0.0.1", server_.port()};
    options.receiver.format = line_sender::time_x_y_z_status();
    options.receiver.time_separation = 2ms;
    return options;
  }

  void run_for(std::chrono::nanoseconds duration) {
    for (const auto end = time_.now() + duration; time_.now() < end; time_.advance(20ms)) {
      server_.poll(time_.now());
      device_->wait(20ms);
      device_->receive();
      take();
    }
  }
  void take() {
    std::vector<protocol::TrackerPoint> points(1024);
    points.resize(device_->samples().pop(points));
    points_.insert(points_.end(), points.begin(), points.end());
    std::vector<protocol::RawBlock> blocks(64);
    blocks.resize(device_->raw().pop(blocks));
    blocks_.insert(blocks_.end(), blocks.begin(), blocks.end());
  }
  /// As the decoder of a recording.
  std::vector<protocol::TrackerPoint> decoded_again() {
    const auto recorded = std::make_unique<drivers::LineBlocks<drivers::LineReceiver>>(
        drivers::receiver_options(options()));
    std::vector<protocol::TrackerPoint> again;
    for (const auto& block : blocks_)
      recorded->take(block,
                     [&](auto points) { again.insert(again.end(), points.begin(), points.end()); });
    return again;
  }

  SteppedTime time_;
  sim::VirtualMachine machine_ = tracker::standing_machine();
  sim::LineTrackerServer server_ =
      sim::LineTrackerServer::open(
          {}, std::make_unique<sim::LineTracker>(tracker_options(), machine_, time_.now()),
          time_.now())
          .value();
  std::unique_ptr<drivers::LineTrackerDevice> device_ =
      drivers::LineTrackerDevice::create(options(), time_).value();
  std::vector<protocol::TrackerPoint> points_;
  std::vector<protocol::RawBlock> blocks_;
};

TEST_F(LineTrackerOverTcp, GivesThePointsOfTheSimulatedTracker) {
  run_for(3s);
  ASSERT_GT(points_.size(), 1000u);
  EXPECT_LE(points_.size(), server_.device().points_sent());
  // 6 standard deviations of the noise: 2 um along the beam, 3 urad across it
  const auto view = sim::observe({}, machine_, time_.now(), 0);
  const double tolerance_m = 6.0 * (2e-6 + 3e-6 * view.p_tracker_m.norm());
  for (const auto& point : points_) {
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(point.p_tracker_m[i], view.p_tracker_m[i], 2.0 * tolerance_m);
    EXPECT_FALSE(has(point.head.flags, protocol::SampleFlag::PointInvalid));
  }
  EXPECT_EQ(device_->status().faults, 0u) << device_->status().last_fault;
}

TEST_F(LineTrackerOverTcp, SettlesItsClockOverBursts) {
  run_for(20s);
  EXPECT_TRUE(device_->status().clock.settled);
  EXPECT_EQ(device_->status().gaps, 0u);
}

TEST_F(LineTrackerOverTcp, DecodesItsRawBytesToTheSamePoints) {
  run_for(2s);
  server_.device().inject({.kind = sim::FaultKind::TrackerGarbage}, time_.now());
  run_for(2s);
  server_.device().inject({.kind = sim::FaultKind::Disconnect}, time_.now());
  run_for(4s);
  const auto again = decoded_again();
  ASSERT_EQ(again.size(), points_.size());
  for (std::size_t i = 0; i < again.size(); ++i) {
    EXPECT_EQ(again[i].head.time, points_[i].head.time);
    EXPECT_EQ(again[i].head.u_time, points_[i].head.u_time);
    EXPECT_EQ(again[i].head.flags, points_[i].head.flags);
    EXPECT_EQ(again[i].p_tracker_m, points_[i].p_tracker_m);
  }
}

TEST_F(LineTrackerOverTcp, ReportsAnUnreadableLineWithItsColumnAndText) {
  run_for(2s);
  server_.device().inject({.kind = sim::FaultKind::TrackerGarbage}, time_.now());
  run_for(1s);
  EXPECT_THAT(device_->status().last_fault, HasSubstr("column 1 (time): not a number"));
  EXPECT_THAT(device_->status().last_fault, HasSubstr("no line 1 of any tracker"));
  EXPECT_EQ(device_->status().state, "streaming");
}

TEST_F(LineTrackerOverTcp, MarksPointsWithAnotherStatusInvalid) {
  run_for(2s);
  server_.device().inject({.kind = sim::FaultKind::PrismError, .duration_s = 0.5}, time_.now());
  run_for(2s);
  const auto invalid = std::ranges::count_if(
      points_, [](const auto& p) { return has(p.head.flags, protocol::SampleFlag::PointInvalid); });
  EXPECT_NEAR(static_cast<double>(invalid), 250.0, 1.0);  // 0.5 s at 500 points per second
}

TEST(LineTrackerDevice, RefusesAFormatWithoutAPosition) {
  SteppedTime time;
  drivers::LineTrackerOptions options;
  options.address = drivers::LineTcp{"127.0.0.1", 7001};
  const auto device = drivers::LineTrackerDevice::create(options, time);
  ASSERT_FALSE(device);
  EXPECT_EQ(device.error().code, drivers::ErrorCode::BadConfiguration);
}

TEST(LineTrackerDevice, ReportsThatPointsComeAtAnotherRate) {
  SteppedTime time;
  line_sender::SenderWire wire{line_sender::SenderWire::Kind::Tcp};
  line_sender::PrintedPoints points{time.now()};
  drivers::LineTrackerOptions options;
  options.address = wire.address();
  options.receiver.format = line_sender::time_x_y_z_status();
  options.receiver.time_separation = 10ms;
  const auto device = drivers::LineTrackerDevice::create(options, time).value();
  for (int i = 0; i < 20; ++i, time.advance(100ms)) {
    wire.serve();
    wire.send(points.until(time.now()));
    device->wait(100ms);
    device->receive();
  }
  EXPECT_THAT(device->status().last_fault, HasSubstr("set point_rate_hz = 500"));
}

}  // namespace
}  // namespace abbe::tests

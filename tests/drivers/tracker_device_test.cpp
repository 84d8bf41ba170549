#include "abbe/drivers/tracker/device.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "abbe/protocol/emscon/requests.hpp"
#include "stepped_time.hpp"
#include "tracker_peer.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::RawBlock;
using protocol::SampleFlag;
using protocol::TrackerPoint;
using testing::HasSubstr;

class TrackerDeviceTest : public testing::Test {
 protected:
  explicit TrackerDeviceTest(const sim::TrackerOptions& options = {})
      : peer_(time_.now(), options) {}

  TrackerDeviceOptions options() const {
    TrackerDeviceOptions o;
    o.host = "127.0.0.1";
    o.port = peer_.port();
    return o;
  }
  void make_device() { device_ = TrackerDevice::create(options(), time_).value(); }

  void cycle() {
    if (served_) {
      peer_.serve(time_.now());
      peer_.send_points();
    }
    device_->wait(20ms);
    device_->receive();
    time_.advance(20ms);
    collect();
  }
  void run(std::chrono::nanoseconds duration) {
    for (const auto end = time_.now() + duration; time_.now() < end;) cycle();
  }
  /// False if 60 s pass without it.
  bool run_until_state(std::string_view state) {
    for (const auto end = time_.now() + 60s; device_->status().state != state;) {
      if (time_.now() >= end) return false;
      cycle();
    }
    return true;
  }
  /// The device thread is delayed: the controller continues, its data are not read.
  void hold_up(std::chrono::nanoseconds duration) {
    for (const auto end = time_.now() + duration; time_.now() < end; time_.advance(20ms)) {
      peer_.serve(time_.now());
      peer_.send_points();
    }
  }
  void collect() {
    std::array<TrackerPoint, 512> points{};
    while (const auto n = device_->points().pop(points))
      points_.insert(points_.end(), points.begin(), points.begin() + n);
    std::array<RawBlock, 16> blocks;
    while (const auto n = device_->raw().pop(blocks))
      raw_.insert(raw_.end(), blocks.begin(), blocks.begin() + n);
  }

  tests::SteppedTime time_;
  tests::tracker::TrackerPeer peer_;
  std::unique_ptr<TrackerDevice> device_;
  bool served_ = true;
  std::vector<TrackerPoint> points_;
  std::vector<RawBlock> raw_;
};

TEST_F(TrackerDeviceTest, StreamsFromTheSimulatedController) {
  make_device();
  ASSERT_TRUE(run_until_state("streaming"));
  run(20s);
  EXPECT_GT(points_.size(), 9'000u);  // 500 per second, the last burst not received yet
  EXPECT_TRUE(device_->status().connected);
  EXPECT_TRUE(device_->status().clock.settled);
  EXPECT_EQ(device_->status().faults, 0u);
  EXPECT_EQ(device_->status().gaps, 0u);
}

TEST_F(TrackerDeviceTest, ReportsTheWeather) {
  make_device();
  ASSERT_TRUE(run_until_state("streaming"));
  run(1s);
  std::array<protocol::EnvironmentSample, 4> samples{};
  ASSERT_GE(device_->environment().pop(samples), 1u);
  EXPECT_NEAR(samples[0].air_temperature_K, 293.15, 0.1);
  EXPECT_NEAR(samples[0].air_pressure_Pa, 101'325.0, 1.0);
  EXPECT_NEAR(samples[0].relative_humidity, 0.5, 1e-6);
}

TEST_F(TrackerDeviceTest, MarksAirThatTheControllerWasSetToAsNotMeasured) {
  auto assuming = options();
  assuming.session.weather = emscon::WeatherMonitor::None;
  assuming.session.environment = {.temperature = 18.0, .pressure = 980.0, .humidity = 30.0};
  device_ = TrackerDevice::create(assuming, time_).value();
  ASSERT_TRUE(run_until_state("streaming"));
  run(1s);
  std::array<protocol::EnvironmentSample, 4> samples{};
  ASSERT_GE(device_->environment().pop(samples), 1u);
  EXPECT_EQ(samples[0].measured, 0);
  EXPECT_NEAR(samples[0].air_temperature_K, 291.15, 1e-9);
}

TEST_F(TrackerDeviceTest, ComesBackAfterALostBeamOnTheSameConnection) {
  make_device();
  ASSERT_TRUE(run_until_state("streaming"));
  run(5s);
  const auto before = points_.size();
  peer_.controller().inject({sim::FaultKind::BeamBreak, 0.0, 3.0, 0.0, 0}, time_.now());

  ASSERT_TRUE(run_until_state("beam lost"));
  ASSERT_TRUE(run_until_state("streaming"));
  run(2s);
  const auto returned = std::find_if(
      points_.begin() + before, points_.end(),
      [](const TrackerPoint& p) { return has(p.head.flags, SampleFlag::BeamReturned); });
  ASSERT_NE(returned, points_.end());
  EXPECT_GT(points_.end() - returned, 500);
  EXPECT_EQ(device_->status().faults, 0u);
  EXPECT_EQ(device_->status().gaps, 1u);
}

TEST_F(TrackerDeviceTest, RawBytesGiveTheSamePointsAgain) {
  make_device();
  ASSERT_TRUE(run_until_state("streaming"));
  run(5s);
  peer_.restart(time_.now());
  run(15s);
  TrackerReceiver receiver{receiver_options(options())};
  std::vector<TrackerPoint> again;

  for (const RawBlock& block : raw_) {
    if (block.direction != RawBlock::Direction::FromDevice) continue;
    receiver.push(std::span{block.bytes}.first(block.length), block.time);
    while (const auto message = receiver.next()) {
      if (const auto* b = std::get_if<TrackerBurst>(&*message))
        again.insert(again.end(), b->points.begin(), b->points.end());
    }
  }

  ASSERT_GT(points_.size(), 3'000u);
  ASSERT_EQ(again.size(), points_.size());
  for (std::size_t k = 0; k < again.size(); ++k) {
    ASSERT_EQ(again[k].head.time, points_[k].head.time) << k;
    ASSERT_EQ(again[k].head.flags, points_[k].head.flags) << k;
    ASSERT_EQ(again[k].p_tracker_m, points_[k].p_tracker_m) << k;
  }
}

TEST_F(TrackerDeviceTest, RecordsItsRequests) {
  make_device();
  ASSERT_TRUE(run_until_state("streaming"));
  run(20ms);
  std::vector<emscon::Command> asked;
  for (const RawBlock& block : raw_) {
    if (block.direction != RawBlock::Direction::ToDevice) continue;
    const auto request = emscon::decode_request(std::span{block.bytes}.first(block.length));
    ASSERT_TRUE(request);
    asked.push_back(emscon::command_of(*request));
  }
  EXPECT_EQ(asked.front(), emscon::Command::GetSystemStatus);
  EXPECT_EQ(asked.back(), emscon::Command::StartMeasurement);
}

TEST_F(TrackerDeviceTest, ReportsWhatAnsweredInsteadOfATracker) {
  make_device();
  cycle();
  cycle();
  ASSERT_TRUE(peer_.connected());
  peer_.send("HTTP/1.1 400 Bad Request\r\n\r\n");
  run(60ms);
  const auto status = device_->status();
  EXPECT_EQ(status.state, "faulted");
  EXPECT_FALSE(status.connected);
  EXPECT_THAT(status.last_fault, HasSubstr("tracker 127.0.0.1:" + std::to_string(peer_.port())));
  EXPECT_THAT(status.last_fault, HasSubstr("expected emScon answer, got 48 54 54 50"));
  EXPECT_TRUE(run_until_state("streaming")) << "it tries again";
}

TEST_F(TrackerDeviceTest, ReportsARefusedConnectionAndTriesAgain) {
  peer_.unplug();
  served_ = false;
  make_device();
  run(100ms);
  EXPECT_EQ(device_->status().state, "disconnected");
  EXPECT_THAT(device_->status().last_fault, HasSubstr("no connection: Connection refused"));
  peer_.listen();
  served_ = true;
  EXPECT_TRUE(run_until_state("streaming"));
}

TEST_F(TrackerDeviceTest, StopsTheMeasurementWhenItEnds) {
  make_device();
  ASSERT_TRUE(run_until_state("streaming"));
  ASSERT_TRUE(peer_.controller().streaming());
  device_.reset();
  peer_.serve(time_.now());
  peer_.serve(time_.now() + 20ms);
  EXPECT_FALSE(peer_.controller().streaming());
}

TEST_F(TrackerDeviceTest, RetriesABusyController) {
  make_device();
  peer_.serve(time_.now());
  peer_.controller().inject({sim::FaultKind::Busy, 0.0, 3.0, 0.0, 0}, time_.now());
  ASSERT_TRUE(run_until_state("streaming"));
  EXPECT_EQ(device_->status().faults, 0u);
}

TEST_F(TrackerDeviceTest, ComesBackAfterAReboot) {
  make_device();
  ASSERT_TRUE(run_until_state("streaming"));
  peer_.controller().inject({sim::FaultKind::Reboot, 0.0, 5.0, 0.0, 0}, time_.now());
  ASSERT_TRUE(run_until_state("disconnected"));
  EXPECT_THAT(device_->status().last_fault, HasSubstr("shutting down"));
  EXPECT_TRUE(run_until_state("streaming"));
}

TEST_F(TrackerDeviceTest, ADelayedThreadReadsItsPointsBeforeItReportsSilence) {
  make_device();
  ASSERT_TRUE(run_until_state("streaming"));
  run(5s);
  hold_up(1500ms + 500ms);
  run(1s);
  EXPECT_EQ(device_->status().state, "streaming");
  EXPECT_EQ(device_->status().faults, 0u) << device_->status().last_fault;
  EXPECT_EQ(device_->status().gaps, 0u);
}

TEST_F(TrackerDeviceTest, ADelayedThreadReadsTheAnswerBeforeItReportsATimeOut) {
  make_device();
  ASSERT_TRUE(run_until_state("configuring"));
  hold_up(3s + 1s);
  ASSERT_TRUE(run_until_state("streaming"));
  EXPECT_EQ(device_->status().faults, 0u) << device_->status().last_fault;
}

TEST_F(TrackerDeviceTest, PointsThatCameInTimeDoNotHideThatNoMoreCome) {
  make_device();
  ASSERT_TRUE(run_until_state("streaming"));
  run(5s);
  peer_.controller().inject({sim::FaultKind::Mute, 0.0, 60.0, 0.0, 0}, time_.now());
  hold_up(4s);
  run(1600ms);
  EXPECT_THAT(device_->status().last_fault, HasSubstr("no points in 1.5 s"));
}

class FastClock : public TrackerDeviceTest {
 protected:
  FastClock() : TrackerDeviceTest(fast()) {}
  static sim::TrackerOptions fast() {
    sim::TrackerOptions o;
    o.model.clock_drift_ppm = 300.0;
    return o;
  }
};

TEST_F(FastClock, IsReportedByNameAndItsPointsAreMarked) {
  make_device();
  ASSERT_TRUE(run_until_state("streaming"));
  run(90s);
  const auto status = device_->status();
  EXPECT_FALSE(status.clock.settled);
  EXPECT_THAT(status.last_fault, HasSubstr("ppm fast, a sound one at most 200 ppm"));
  EXPECT_EQ(status.faults, 1u);
  EXPECT_TRUE(has(points_.back().head.flags, SampleFlag::ClockUnsettled));
  EXPECT_GT(points_.back().head.u_time,
            4ms);  // 100 ppm over a minute are 6 ms, less what the scatter hides
}

class ColdTracker : public TrackerDeviceTest {
 protected:
  ColdTracker() : TrackerDeviceTest(cold()) {}
  static sim::TrackerOptions cold() {
    sim::TrackerOptions o;
    o.warm_up = 20s;
    return o;
  }
};

TEST_F(ColdTracker, IsWaitedFor) {
  make_device();
  ASSERT_TRUE(run_until_state("warming up"));
  ASSERT_TRUE(run_until_state("streaming"));
  EXPECT_EQ(device_->status().faults, 0u);
}

TEST(TrackerDeviceOptions, WithoutAHostAreRefused) {
  tests::SteppedTime time;
  TrackerDeviceOptions options;
  options.host = "";
  const auto device = TrackerDevice::create(options, time);
  ASSERT_FALSE(device);
  EXPECT_EQ(device.error().code, ErrorCode::BadConfiguration);
}

}  // namespace
}  // namespace abbe::drivers

// The machine sends the SYNC and has configured its encoders: not one frame may come from here.
#include <gmock/gmock.h>

#include <vector>

#include "abbe/drivers/can/encoder_device.hpp"
#include "abbe/drivers/can/udp_can_bus.hpp"
#include "abbe/sim/encoder_bus.hpp"
#include "encoder_peer.hpp"
#include "stepped_time.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::AxisSample;
using testing::AllOf;
using testing::Each;
using testing::Field;
using testing::HasSubstr;

constexpr auto kPeriod = 4ms;

sim::VirtualMachine machine_at(double x, double y) {
  sim::PathPlan plan;
  plan.vertices = {{{x, y, 0.0}}};
  return {sim::TruthMachine{}, sim::PathMotion::plan(plan).value()};
}

/// A port that is free now; another program may have it a moment later.
std::uint16_t free_port() {
  return tests::EncoderPeer{std::span<const can::EncoderIdentity>{}}.port();
}

/// A machine with two encoders that its control has configured, and the device, on one stepped
/// clock.
class ExternalSync : public testing::Test {
 protected:
  void SetUp() override {
    constexpr int kMostTries = 100;
    for (int i = 0; i < kMostTries; ++i) {
      port_ = free_port();
      bus_ = open_bus();
      open_device();
      if (device_->status().faults == 0) return;
    }
    FAIL() << device_->status().last_fault;
  }
  void open_device() {
    EncoderDeviceOptions options;
    options.receiver.axes = {{.name = "X", .node = 1, .scale = 10e-9},
                             {.name = "Y", .node = 2, .scale = 10e-9}};
    options.receiver.sync_period = kPeriod;
    options.receiver.external_sync = true;
    options.sync = SyncSource::External;
    const UdpCanOptions udp{.local_port = port_, .peer_port = bus_.port(), .speed = 0.0};
    device_ =
        std::move(*EncoderDevice::create(options, std::make_unique<UdpCanBus>(udp, time_), time_));
    device_->wait(0ms);
    device_->receive();
  }
  sim::EncoderBus open_bus() {
    const std::array<sim::EncoderNodeOptions, 2> nodes{
        sim::EncoderNodeOptions{.node = 1, .axis = sim::Axis::X, .noise = 0.0, .configured = true},
        sim::EncoderNodeOptions{.node = 2, .axis = sim::Axis::Y, .noise = 0.0, .configured = true}};
    return sim::EncoderBus::open({.peer_port = port_}, nodes, machine_, time_.now()).value();
  }
  void cycle() {
    bus_.poll(time_.now());
    device_->wait(1ms);
    device_->receive();
    time_.advance(1ms);
    std::array<AxisSample, 64> out{};
    const auto n = device_->samples().pop(out);
    samples_.insert(samples_.end(), out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n));
  }
  void turns(std::chrono::milliseconds duration) {
    for (auto n = duration.count(); n > 0; --n) cycle();
  }
  void run_until_streaming() {
    bus_.produce_sync(kPeriod, time_.now() + kPeriod);
    turns(500ms);
    ASSERT_EQ(device_->status().state, "streaming") << device_->status().last_fault;
    samples_.clear();
  }

  tests::SteppedTime time_;
  sim::VirtualMachine machine_ = machine_at(0.1, -0.2);
  std::uint16_t port_ = free_port();
  sim::EncoderBus bus_ = open_bus();
  std::unique_ptr<EncoderDevice> device_;
  std::vector<AxisSample> samples_;
};

TEST_F(ExternalSync, GivesASampleForEverySyncOfTheMachineAndSendsNothing) {
  run_until_streaming();
  turns(1s);
  ASSERT_GT(samples_.size(), 240u);
  EXPECT_THAT(samples_, Each(Field(&AxisSample::missing_mask, 0)));
  EXPECT_DOUBLE_EQ(samples_.back().position[0], 0.1);
  EXPECT_DOUBLE_EQ(samples_.back().position[1], -0.2);
  for (std::size_t i = 1; i < samples_.size(); ++i)
    EXPECT_EQ(samples_[i].head.time - samples_[i - 1].head.time, kPeriod);
  EXPECT_EQ(bus_.frames_received(), 0u);
  EXPECT_EQ(device_->status().faults, 0u) << device_->status().last_fault;
}

TEST_F(ExternalSync, SendsNothingWhateverHappensOnTheBus) {
  run_until_streaming();
  for (const auto kind :
       {sim::FaultKind::Mute, sim::FaultKind::Restart, sim::FaultKind::Emergency,
        sim::FaultKind::BusOff, sim::FaultKind::BusGarbage, sim::FaultKind::Late}) {
    bus_.inject({kind, 0.0, 1.0, 0.01, 0}, time_.now());
    turns(3s);
  }
  EXPECT_EQ(bus_.frames_received(), 0u);
  EXPECT_EQ(device_->status().state, "streaming") << device_->status().last_fault;
}

TEST_F(ExternalSync, ReportsThatNoSyncComes) {
  turns(2s);
  EXPECT_EQ(device_->status().state, "no SYNC");
  EXPECT_THAT(device_->status().last_fault, AllOf(HasSubstr("no SYNC"), HasSubstr("1500 ms")));
  EXPECT_EQ(bus_.frames_received(), 0u);
  EXPECT_TRUE(samples_.empty());
}

TEST_F(ExternalSync, ReportsAPeriodOtherThanConfigured) {
  bus_.produce_sync(10ms, time_.now());
  turns(4s);
  EXPECT_THAT(device_->status().last_fault,
              AllOf(HasSubstr("10.000 ms"), HasSubstr("sync_period_us = 4000")));
  EXPECT_EQ(device_->status().faults, 1u);
}

TEST_F(ExternalSync, ShowsAnAxisThatIsMissing) {
  run_until_streaming();
  bus_.inject({sim::FaultKind::Mute, 0.0, 10.0, 0.0, 2}, time_.now());
  turns(500ms);
  EXPECT_EQ(device_->status().state, "degraded");
  EXPECT_EQ(samples_.back().missing_mask, 0b10);
}

TEST_F(ExternalSync, ReplaysItsRawBytesToTheSameSamples) {
  run_until_streaming();
  turns(100ms);
  EncoderReceiverOptions options;
  options.axes = {{.name = "X", .node = 1, .scale = 10e-9},
                  {.name = "Y", .node = 2, .scale = 10e-9}};
  options.sync_period = kPeriod;
  options.external_sync = true;
  EncoderReceiver replay{options};
  std::vector<AxisSample> again;
  std::array<protocol::RawBlock, 64> blocks;  // NOLINT: filled by pop

  while (const auto n = device_->raw().pop(blocks)) {
    for (std::size_t i = 0; i < n; ++i)
      replay.on_raw(blocks[i], [&](const AxisSample& s) { again.push_back(s); });
  }

  ASSERT_GE(again.size(), samples_.size());
  EXPECT_EQ(again.back().head.time, samples_.back().head.time);
  EXPECT_EQ(again.back().count, samples_.back().count);
}

}  // namespace
}  // namespace abbe::drivers

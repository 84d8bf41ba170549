// The encoder driver with its own thread against the simulated nodes on a virtual CAN bus: SYNC by
// the device thread and by the kernel. Real time on an emulated processor: these tests must
// pass with any delay. The deadlines are in deadlines_test.cpp.

#include <gmock/gmock.h>
#include <algorithm>

#include "abbe/drivers/can/socket_can_bus.hpp"
#include "abbe/drivers/device_thread.hpp"
#include "simulated_encoders.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::SyncSource;
using protocol::AxisSample;
using protocol::SampleFlag;
using sim::FaultKind;
using testing::HasSubstr;

constexpr std::size_t kAxes = 5;
// An answer that is late by a whole period casts doubt on the next: long enough for an emulated,
// loaded processor.
constexpr auto kPeriod = 10ms;

class EncodersOnVcan : public testing::TestWithParam<SyncSource> {
 protected:
  EncodersOnVcan() {
    drivers::EncoderDeviceOptions options;
    options.receiver.axes = SimulatedEncoders::axes(kAxes);
    options.receiver.sync_period = kPeriod;
    options.sync = GetParam();
    device = std::move(*drivers::EncoderDevice::create(
        options,
        std::make_unique<drivers::SocketCanBus>(drivers::SocketCanOptions{.interface = vcan.name()},
                                                time),
        time));
    thread =
        std::move(*drivers::DeviceThread::start(*device, {.name = "encoders", .priority = 50}));
  }
  void collect() {
    std::array<AxisSample, 1024> some{};
    const auto n = device->samples().pop(some);
    samples.insert(samples.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(n));
    std::array<protocol::RawBlock, 1024> blocks;  // NOLINT: filled by pop
    const auto m = device->raw().pop(blocks);
    raw.insert(raw.end(), blocks.begin(), blocks.begin() + static_cast<std::ptrdiff_t>(m));
  }
  template <class Done>
  bool until(Done done, std::chrono::seconds limit = 10s) {
    for (const auto end = time.now() + limit; time.now() < end;) {
      collect();
      if (done()) return true;
      ::usleep(5'000);
    }
    return false;
  }
  bool state_becomes(std::string_view state) {
    return until([&] { return device->status().state == state; });
  }
  static bool complete(const AxisSample& s) { return s.missing_mask == 0; }
  void begin_streaming() {
    ASSERT_TRUE(state_becomes("streaming")) << device->status().last_fault;
    ASSERT_TRUE(until([&] { return !samples.empty() && complete(samples.back()); }));
    samples.clear();
  }
  template <class Is>
  double share_of(Is is) const {
    const auto n = std::count_if(samples.begin(), samples.end(), is);
    return static_cast<double>(n) / static_cast<double>(samples.size());
  }
  bool seen(SampleFlag flag) const {
    return std::any_of(samples.begin(), samples.end(),
                       [&](const auto& s) { return has(s.head.flags, flag); });
  }

  drivers::MonotonicTime time;
  VirtualCan vcan;
  SimulatedEncoders encoders{vcan, kAxes};
  CanSocket other{vcan};
  std::unique_ptr<drivers::EncoderDevice> device;
  std::unique_ptr<drivers::DeviceThread> thread;
  std::vector<AxisSample> samples;
  std::vector<protocol::RawBlock> raw;
};

TEST_P(EncodersOnVcan, GiveOneSampleForEverySyncAndAccountForTheOthers) {
  begin_streaming();
  ASSERT_TRUE(until([&] { return samples.size() >= 150; }));
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const auto& s = samples[i];
    ASSERT_EQ(complete(s), !has(s.head.flags, SampleFlag::AxisMissing));
    ASSERT_EQ(s.cycle, samples[i - 1].cycle + 1);
    ASSERT_EQ(s.head.lost_before != 0, has(s.head.flags, SampleFlag::GapBefore));
  }
  EXPECT_GT(share_of([](const auto& s) { return complete(s); }), 0.9);
  EXPECT_EQ(device->status().dropped, 0u);
}

TEST_P(EncodersOnVcan, StampAllAxesWithTheOneTimeOfTheSync) {
  begin_streaming();
  ASSERT_TRUE(until([&] { return samples.size() >= 100; }));
  std::erase_if(samples, [](const auto& s) { return !complete(s); });

  // Nodes on one axis of the machine took their positions at one time, and that time is the
  // sample's. Any process may still lose an emulated processor between two readings of the clocks.
  EXPECT_GT(
      share_of([](const auto& s) { return s.count[0] == s.count[3] && s.count[1] == s.count[4]; }),
      0.9);
  EXPECT_GT(share_of([&](const auto& s) {
              const double off_m = std::abs(s.position[0] - encoders.reading_m(0, s.head.time));
              return off_m <= kFeed_m_per_s * 200e-6 + 10e-9;
            }),
            0.9);
}

TEST_P(EncodersOnVcan, MarkAnAxisThatIsMissing) {
  begin_streaming();
  encoders.inject({.kind = FaultKind::Mute, .duration_s = 0.2, .node = 3});
  ASSERT_TRUE(until([&] {
    return std::any_of(samples.begin(), samples.end(),
                       [](const auto& s) { return s.missing_mask == 0b100; });
  }));
  ASSERT_TRUE(until([&] { return complete(samples.back()); }));
}

TEST_P(EncodersOnVcan, ReportThatTheControllerIsErrorPassive) {
  begin_streaming();
  ASSERT_TRUE(other.send_condition(can::BusCondition::Passive));
  EXPECT_TRUE(until([&] { return seen(SampleFlag::BusError); }));
  EXPECT_EQ(device->status().state, "streaming");
}

TEST_P(EncodersOnVcan, ReportBusOffAtOnceAndRecover) {
  begin_streaming();
  encoders.inject({.kind = FaultKind::BusOff, .duration_s = 0.3});
  ASSERT_TRUE(state_becomes("bus off"));
  ASSERT_TRUE(until([&] { return seen(SampleFlag::BusOff); }));
  EXPECT_FALSE(device->status().connected);
  ASSERT_TRUE(state_becomes("streaming"));
  ASSERT_TRUE(until([&] { return seen(SampleFlag::Restarted) && complete(samples.back()); }));
}

TEST_P(EncodersOnVcan, ReportThatTheInterfaceIsDownAndRecoverWhenItIsUp) {
  begin_streaming();
  vcan.down();

  ASSERT_TRUE(state_becomes("closed"));
  EXPECT_FALSE(device->status().connected);
  EXPECT_THAT(device->status().last_fault, HasSubstr("Network is down"));
  const auto faults = device->status().faults;
  ::usleep(1'200'000);
  EXPECT_LE(device->status().faults, faults + 1)
      << "one refusal is one fault, however often it is tried";
  collect();  // the last samples of the closed connection
  samples.clear();
  vcan.up();
  const auto up = time.now();
  ASSERT_TRUE(until([&] { return !samples.empty() && complete(samples.back()); }));
  EXPECT_LT(time.now() - up, 3s);  // an emulated processor; measured in deadlines_test.cpp
  EXPECT_TRUE(seen(SampleFlag::GapBefore) || seen(SampleFlag::Restarted));
}

TEST_P(EncodersOnVcan, ReplayFromTheRawBytesToTheSameSamples) {
  begin_streaming();
  ASSERT_TRUE(until([&] { return samples.size() >= 100; }));
  thread->stop();
  collect();
  drivers::EncoderReceiver replay{{.axes = SimulatedEncoders::axes(kAxes), .sync_period = kPeriod}};
  std::vector<AxisSample> again;
  for (const auto& block : raw)
    replay.on_raw(block, [&](const AxisSample& s) { again.push_back(s); });
  ASSERT_GE(again.size(), samples.size());
  again.erase(again.begin(), again.end() - static_cast<std::ptrdiff_t>(samples.size()));

  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(again[i].head.time, samples[i].head.time);
    EXPECT_EQ(again[i].count, samples[i].count);
    EXPECT_EQ(again[i].missing_mask, samples[i].missing_mask);
  }
}

INSTANTIATE_TEST_SUITE_P(Sync, EncodersOnVcan,
                         testing::Values(SyncSource::Thread, SyncSource::Kernel), sync_name);

class SyncOfTheDevice : public testing::TestWithParam<SyncSource> {};

TEST_P(SyncOfTheDevice, DetectsAnotherSyncProducer) {
  // Frames of this computer cannot be distinguished from the kernel's own SYNC; but before the
  // kernel's SYNC has run, none is ours.
  drivers::MonotonicTime time;
  const VirtualCan vcan;
  drivers::EncoderDeviceOptions options;
  options.receiver.axes = SimulatedEncoders::axes(1);
  options.sync = GetParam();
  auto bus = std::make_unique<drivers::SocketCanBus>(
      drivers::SocketCanOptions{.interface = vcan.name()}, time);
  auto device = std::move(*drivers::EncoderDevice::create(options, std::move(bus), time));
  device->wait(1ms);
  const CanSocket foreign{vcan};

  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(foreign.send(can::encode_sync()));
    device->wait(100ms);
  }

  EXPECT_EQ(device->status().state, "foreign SYNC");
  EXPECT_THAT(device->status().last_fault, HasSubstr("another SYNC producer"));
}

INSTANTIATE_TEST_SUITE_P(Sync, SyncOfTheDevice,
                         testing::Values(SyncSource::Thread, SyncSource::Kernel), sync_name);

TEST(EncodersWithoutAnInterface, NameTheMissingInterfaceOnce) {
  drivers::MonotonicTime time;
  drivers::EncoderDeviceOptions options;
  options.receiver.axes = SimulatedEncoders::axes(1);
  options.reopen_after = 10ms;
  auto bus = std::make_unique<drivers::SocketCanBus>(
      drivers::SocketCanOptions{.interface = "can99"}, time);
  auto device = std::move(*drivers::EncoderDevice::create(options, std::move(bus), time));
  for (int turn = 0; turn < 20; ++turn) device->wait(10ms);
  EXPECT_EQ(device->status().faults, 1u);
  EXPECT_THAT(device->status().last_fault,
              testing::AllOf(HasSubstr("can99"), HasSubstr("No such device")));
}

}  // namespace
}  // namespace abbe::tests

// The SocketCAN transport and the encoder driver on two emulated Kvaser PCI cards (SJA1000
// controllers with the kernel's own driver) on one bus: can0 is ours, can1 the rest of the world.
// Not paced by the bit rate, and the emulator has no bus errors: no missing acknowledge, no
// bus-off; see vcan for those, and a real controller for restart-ms.

#include <gmock/gmock.h>
#include <fstream>

#include "abbe/drivers/can/socket_can_bus.hpp"
#include "abbe/drivers/device_thread.hpp"
#include "simulated_encoders.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::ReceivedFrame;
using drivers::SocketCanBus;
using testing::HasSubstr;

constexpr std::array<std::uint32_t, 1> kIds{0x181};

std::string said_by(const std::string& command) {
  std::string text;
  FILE* pipe = ::popen(command.c_str(), "r");
  std::array<char, 4096> some{};
  while (pipe != nullptr && std::fgets(some.data(), some.size(), pipe) != nullptr)
    text += some.data();
  if (pipe != nullptr) ::pclose(pipe);
  return text;
}

std::uint64_t statistic(const std::string& interface, const std::string& name) {
  std::ifstream file{"/sys/class/net/" + interface + "/statistics/" + name};
  std::uint64_t value = 0;
  file >> value;
  return value;
}

struct Kvaser : testing::Test {
  CanInterface ours{"can0"};
  CanInterface theirs{"can1"};
  drivers::MonotonicTime time;

  void SetUp() override {
    for (const auto* interface : {&ours, &theirs}) {
      (void)run("ip link set " + interface->name() + " down");
      ASSERT_TRUE(run("ip link set " + interface->name() +
                      " type can bitrate 1000000 restart-ms 100 berr-reporting on"));
      ASSERT_TRUE(run("ip link set " + interface->name() + " txqueuelen 1000 up"));
    }
  }
  static std::vector<ReceivedFrame> read(SocketCanBus& from, std::size_t wanted) {
    std::vector<ReceivedFrame> all;
    std::array<ReceivedFrame, 256> some{};
    while (all.size() < wanted) {
      const auto n = from.read(some, 500ms);
      EXPECT_TRUE(n.has_value());
      if (!n || n->frames == 0) break;
      all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(n->frames));
    }
    return all;
  }
};

TEST_F(Kvaser, IsConfiguredAsInTheHandbook) {
  const auto said = said_by("ip -details link show can0");
  EXPECT_THAT(said, HasSubstr("state ERROR-ACTIVE"));
  EXPECT_THAT(said, HasSubstr("restart-ms 100"));
  EXPECT_THAT(said, HasSubstr("bitrate 1000000 sample-point 0.750"));
}

TEST_F(Kvaser, CarriesFramesBothWaysWithKernelStamps) {
  SocketCanBus bus{{.interface = "can0"}, time};
  ASSERT_TRUE(bus.open(kIds).has_value());
  const CanSocket other{theirs};
  wait_for_stamps(bus, other, can::standard_frame(0x181, {0}));
  const auto widened = bus.counters().time_widened;

  for (std::uint8_t n = 0; n < 100; ++n) {
    ASSERT_TRUE(other.send(can::standard_frame(0x181, {n})));
    const auto got = read(bus, 1);
    ASSERT_EQ(got.size(), 1u);
    EXPECT_EQ(got[0].frame, can::standard_frame(0x181, {n}));
  }

  EXPECT_EQ(bus.counters().time_widened, widened);
  ASSERT_TRUE(bus.send(std::array{can::standard_frame(0x601, {1})}).has_value());
  EXPECT_EQ(other.receive(1000ms), can::standard_frame(0x601, {1}));
}

TEST_F(Kvaser, RefusesFdBecauseItIsClassic) {
  SocketCanBus bus{{.interface = "can0", .require_fd = true}, time};
  const auto refused = bus.open(kIds);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("classic"));
}

TEST_F(Kvaser, AccountsForEveryFrameOfABurst) {
  constexpr std::size_t kBurst = 2000;
  SocketCanBus bus{{.interface = "can0"}, time};
  ASSERT_TRUE(bus.open(kIds).has_value());
  const CanSocket other{theirs};
  const auto overruns_before = statistic("can0", "rx_over_errors");
  std::size_t sent = 0;

  for (std::size_t n = 0; n < kBurst; ++n) {
    while (!other.send(can::standard_frame(0x181, {1, 2, 3, 4}))) ::usleep(200);
    ++sent;
  }

  std::size_t data = 0;
  std::size_t overflows = 0;
  for (const auto& received : read(bus, 2 * kBurst)) {
    const auto report = can::decode_error_frame(received.frame);
    data += report ? 0 : 1;
    overflows += report && has(report->conditions, can::BusCondition::ReceiveOverflow) ? 1 : 0;
  }

  // The controller's own FIFO may overflow, which it reports; an overflow of the kernel's queue is
  // counted.
  const bool all = data + bus.counters().lost == sent;
  EXPECT_TRUE(all || overflows != 0) << data << " of " << sent << ", no overflow told";
  EXPECT_EQ(overflows, statistic("can0", "rx_over_errors") - overruns_before);
}

TEST_F(Kvaser, ReportsThatTheLinkIsDownAndRecovers) {
  SocketCanBus bus{{.interface = "can0"}, time};
  ASSERT_TRUE(bus.open(kIds).has_value());
  ours.down();
  std::array<ReceivedFrame, 4> frames{};
  const auto failed = bus.read(frames, 1s);
  ASSERT_FALSE(failed);
  EXPECT_THAT(failed.error().text, HasSubstr("Network is down"));
  ours.up();
  ASSERT_TRUE(bus.open(kIds).has_value());
  const CanSocket other{theirs};
  ASSERT_TRUE(other.send(can::standard_frame(0x181, {9})));
  EXPECT_EQ(read(bus, 1).size(), 1u);
}

TEST_F(Kvaser, ReportsTheSyncWhenItHasLeftTheController) {
  SocketCanBus bus{{.interface = "can0"}, time};
  ASSERT_TRUE(bus.open(std::array<std::uint32_t, 1>{can::cob::kSync}).has_value());
  ASSERT_TRUE(bus.start_sync(5ms).has_value());
  const auto got = read(bus, 50);
  ASSERT_GE(got.size(), 50u);
  for (const auto& received : got) EXPECT_TRUE(received.echo);
  for (std::size_t i = 1; i < got.size(); ++i) EXPECT_GT(got[i].time, got[i - 1].time);
}

TEST_F(Kvaser, ReportsOurOwnSyncWhenItHasLeftTheController) {
  SocketCanBus bus{{.interface = "can0"}, time};
  ASSERT_TRUE(bus.open(std::array<std::uint32_t, 1>{can::cob::kSync}).has_value());
  const CanSocket other{theirs};
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(bus.send(std::array{can::encode_sync()}).has_value());
    const auto got = read(bus, 1);
    ASSERT_EQ(got.size(), 1u);
    EXPECT_TRUE(got[0].echo);
    ASSERT_TRUE(other.receive(1000ms).has_value());
  }
}

TEST_F(Kvaser, DetectsAForeignSyncBesideTheKernels) {
  SocketCanBus bus{{.interface = "can0"}, time};
  ASSERT_TRUE(bus.open(std::array<std::uint32_t, 1>{can::cob::kSync}).has_value());
  const CanSocket foreign{theirs};
  ASSERT_TRUE(foreign.send(can::encode_sync()));
  const auto got = read(bus, 1);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_FALSE(got[0].echo);
}

struct KvaserStream : Kvaser, testing::WithParamInterface<drivers::SyncSource> {};

TEST_P(KvaserStream, GivesFiveAxesThroughTheRealDriver) {
  const SimulatedEncoders encoders{theirs, 5};
  drivers::EncoderDeviceOptions options;
  options.receiver.axes = SimulatedEncoders::axes(5);
  options.receiver.sync_period = 5ms;  // an emulated controller on an emulated processor
  options.sync = GetParam();
  auto device = std::move(*drivers::EncoderDevice::create(
      options, std::make_unique<SocketCanBus>(drivers::SocketCanOptions{.interface = "can0"}, time),
      time));
  const auto thread =
      std::move(*drivers::DeviceThread::start(*device, {.name = "encoders", .priority = 50}));
  std::size_t complete = 0;

  for (const auto end = time.now() + 10s; complete < 200 && time.now() < end; ::usleep(5'000)) {
    std::array<protocol::AxisSample, 256> some{};
    const auto n = device->samples().pop(some);
    for (std::size_t i = 0; i < n; ++i) complete += some[i].missing_mask == 0 ? 1 : 0;
  }

  EXPECT_GE(complete, 200u) << device->status().last_fault;
  EXPECT_EQ(device->status().state, "streaming");
}

INSTANTIATE_TEST_SUITE_P(Sync, KvaserStream,
                         testing::Values(drivers::SyncSource::Thread, drivers::SyncSource::Kernel),
                         sync_name);

}  // namespace
}  // namespace abbe::tests

// The SocketCAN transport against the kernel's own CAN stack, on a virtual bus.

#include <gmock/gmock.h>
#include <set>

#include "abbe/drivers/can/socket_can_bus.hpp"
#include "can_interface.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using can::FrameFlag;
using drivers::ErrorCode;
using drivers::MonotonicTime;
using drivers::ReceivedFrame;
using drivers::SocketCanBus;
using drivers::SocketCanOptions;
using testing::HasSubstr;

constexpr std::array<std::uint32_t, 2> kIds{0x181, 0x701};

can::CanFrame numbered(std::uint32_t n) {
  return can::standard_frame(0x181,
                             {static_cast<std::uint8_t>(n), static_cast<std::uint8_t>(n >> 8)});
}

struct SocketCan : testing::Test {
  MonotonicTime time;
  VirtualCan vcan;
  CanSocket other{vcan};
  SocketCanBus bus{{.interface = vcan.name()}, time};

  void SetUp() override { open(bus); }
  static void open(SocketCanBus& bus) {
    const auto opened = bus.open(kIds);
    ASSERT_TRUE(opened.has_value()) << opened.error().text;
  }
  /// Reads until `wanted` frames are there or nothing came for a second.
  static std::vector<ReceivedFrame> read(SocketCanBus& from, std::size_t wanted) {
    std::vector<ReceivedFrame> all;
    std::array<ReceivedFrame, 256> some{};
    while (all.size() < wanted) {
      const auto n = from.read(some, 1s);
      EXPECT_TRUE(n.has_value());
      if (!n || n->frames == 0) break;
      all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(n->frames));
    }
    return all;
  }
};

TEST_F(SocketCan, DeliversOnlyTheIdentifiersAskedFor) {
  auto extended = can::standard_frame(0x181, {3});
  extended.set(FrameFlag::Extended);
  auto remote = can::standard_frame(0x181, {});
  remote.set(FrameFlag::Remote);
  const std::array sent{
      can::standard_frame(0x180, {1}), can::standard_frame(0x701, {5}), extended, remote,
      can::standard_frame(0x182, {1}), can::standard_frame(0x181, {2})};

  ASSERT_TRUE(other.send(sent));
  const auto got = read(bus, 2);
  ASSERT_EQ(got.size(), 2u);
  EXPECT_EQ(got[0].frame, sent[1]);
  EXPECT_EQ(got[1].frame, sent[5]);
  std::array<ReceivedFrame, 4> more{};
  EXPECT_EQ(bus.read(more, 0s).value_or(drivers::CanRead{.frames = 1}).frames, 0u);
}

TEST_F(SocketCan, DatesAFrameByTheKernelNotByWhenItWasRead) {
  wait_for_stamps(bus, other, numbered(0));
  const auto widened = bus.counters().time_widened;
  const auto before = time.now();
  ASSERT_TRUE(other.send(numbered(1)));
  const auto after = time.now();
  ASSERT_EQ(::usleep(50'000), 0);  // the frame waits in the kernel
  const auto got = read(bus, 1);
  ASSERT_EQ(got.size(), 1u);
  // Two clocks are read one after the other, and this thread may lose the processor in between.
  EXPECT_GE(got[0].time, before - 5ms);
  EXPECT_LE(got[0].time, after + 5ms);
  EXPECT_EQ(bus.counters().time_widened, widened);
}

TEST_F(SocketCan, DatesEveryFrameOfABatchByTheKernel) {
  wait_for_stamps(bus, other, numbered(0));
  const auto widened = bus.counters().time_widened;
  for (std::uint32_t n = 0; n < 50; ++n) ASSERT_TRUE(other.send(numbered(n)));
  const auto got = read(bus, 50);
  ASSERT_EQ(got.size(), 50u);
  EXPECT_EQ(bus.counters().time_widened, widened);
  std::set<protocol::HostTime> times;

  for (std::size_t i = 0; i < got.size(); ++i) {
    times.insert(got[i].time);
    if (i != 0) {
      EXPECT_GE(got[i].time, got[i - 1].time);
    }
  }

  EXPECT_GT(times.size(), 25u);  // one time for all would be that of the read
}

TEST_F(SocketCan, CountsWhatDidNotFitIntoTheKernelsQueue) {
  constexpr std::uint32_t kSent = 5000;
  SocketCanBus narrow{{.interface = vcan.name(), .receive_buffer_bytes = 4096}, time};
  open(narrow);
  for (std::uint32_t n = 0; n < kSent; ++n) ASSERT_TRUE(other.send(numbered(n)));
  const auto got = read(narrow, kSent).size();
  ASSERT_LT(got, kSent);

  // The kernel reports it with the next frame.
  ASSERT_TRUE(other.send(numbered(kSent)));
  const auto after = read(narrow, 2);
  ASSERT_EQ(after.size(), 2u);
  const auto mark = can::decode_error_frame(after[0].frame);
  ASSERT_TRUE(mark.has_value()) << "the loss is marked where it was";
  EXPECT_TRUE(has(mark->conditions, can::BusCondition::ReceiveOverflow));
  EXPECT_EQ(after[1].frame, numbered(kSent));
  EXPECT_EQ(narrow.counters().lost, kSent - got);
}

TEST_F(SocketCan, HoldsASecondOfFiveAxesAtOneKilohertz) {
  constexpr std::uint32_t kSent = 6000;
  for (std::uint32_t n = 0; n < kSent; ++n) ASSERT_TRUE(other.send(numbered(n)));
  // Root may have the buffer it asks for; without CAP_NET_ADMIN net.core.rmem_max rules.
  SocketCanBus wide{{.interface = vcan.name(), .receive_buffer_bytes = 8 << 20}, time};
  open(wide);
  for (std::uint32_t n = 0; n < kSent; ++n) ASSERT_TRUE(other.send(numbered(n)));
  EXPECT_EQ(read(wide, kSent).size(), kSent);
  EXPECT_EQ(wide.counters().lost, 0u);
}

TEST_F(SocketCan, CarriesCanFdFrames) {
  auto fd = can::standard_frame(0x181, {1});
  fd.set(FrameFlag::Fd);
  fd.fd_flags = CANFD_BRS;
  fd.length = 64;
  fd.data[63] = std::byte{0x5A};
  ASSERT_TRUE(other.send(fd));
  const auto got = read(bus, 1);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_EQ(got[0].frame, fd);
  ASSERT_TRUE(bus.send({&fd, 1}).has_value());
  EXPECT_EQ(other.receive(1000ms), fd);
}

TEST_F(SocketCan, RefusesAClassicInterfaceWhereFdIsAskedFor) {
  const VirtualCan classic{CAN_MTU, "vcan8"};
  SocketCanBus strict{{.interface = "vcan8", .require_fd = true}, time};
  const auto refused = strict.open(kIds);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::BadConfiguration);
  EXPECT_THAT(refused.error().text, HasSubstr("vcan8"));
  SocketCanBus content{{.interface = "vcan8"}, time};
  EXPECT_TRUE(content.open(kIds).has_value());
}

TEST_F(SocketCan, ReportsTheControllersBusState) {
  for (const auto condition :
       {can::BusCondition::Passive, can::BusCondition::BusOff, can::BusCondition::Restarted}) {
    ASSERT_TRUE(other.send_condition(condition));
    const auto got = read(bus, 1);
    ASSERT_EQ(got.size(), 1u);
    const auto report = can::decode_error_frame(got[0].frame);
    ASSERT_TRUE(report.has_value());
    EXPECT_TRUE(has(report->conditions, condition));
  }
}

TEST_F(SocketCan, AFullReadWithAFrameOfItsOwnAmongItIsNotTheEnd) {
  constexpr std::array<std::uint32_t, 1> kOwn{0x181};
  ASSERT_TRUE(bus.open(kOwn).has_value());

  // its echo comes back and is not handed on
  ASSERT_TRUE(bus.send(std::array{numbered(0)}).has_value());
  for (std::uint32_t i = 1; i <= 8; ++i) ASSERT_TRUE(other.send(numbered(i)));
  std::array<ReceivedFrame, 8> some{};
  const auto first = bus.read(some, 1s);
  ASSERT_TRUE(first.has_value());
  EXPECT_EQ(first->frames, 7u);
  EXPECT_FALSE(first->all);
  const auto second = bus.read(some, 1s);
  ASSERT_TRUE(second.has_value());
  EXPECT_EQ(second->frames, 1u);
  EXPECT_TRUE(second->all);
}

TEST_F(SocketCan, ReportsThatTheInterfaceWentDownAndReopensWhenItIsUp) {
  std::array<ReceivedFrame, 4> frames{};
  vcan.down();
  const auto failed = bus.read(frames, 1s);

  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().code, ErrorCode::SystemRefused);
  EXPECT_THAT(failed.error().text, HasSubstr("Network is down"));
  const auto refused = bus.open(kIds);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("ip link set up"));
  vcan.up();
  open(bus);
  (void)other.send(numbered(7));  // the first write may report that the interface was down
  ASSERT_TRUE(other.send(numbered(7)));
  EXPECT_GE(read(bus, 1).size(), 1u);
}

TEST_F(SocketCan, ReportsThatTheInterfaceIsGone) {
  vcan.remove();
  std::array<ReceivedFrame, 4> frames{};
  ASSERT_FALSE(bus.read(frames, 1s));
  const auto refused = bus.open(kIds);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("vcan7"));
  EXPECT_THAT(refused.error().text, HasSubstr("No such device"));
}

struct OwnSync : SocketCan {
  static constexpr std::array<std::uint32_t, 2> kWithSync{0x080, 0x181};
  void SetUp() override { ASSERT_TRUE(bus.open(kWithSync).has_value()); }
};

TEST_F(OwnSync, ComesBackAsAnEchoWithItsTimeOfSending) {
  wait_for_stamps(bus, other, numbered(0));
  const auto before = time.now();
  ASSERT_TRUE(bus.send(std::array{can::encode_sync()}).has_value());
  const auto after = time.now();
  ASSERT_EQ(::usleep(50'000), 0);  // the echo waits in the kernel
  const auto got = read(bus, 1);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_TRUE(got[0].echo);
  EXPECT_TRUE(can::decode_sync(got[0].frame).has_value());
  EXPECT_FALSE(got[0].time_widened);
  EXPECT_GE(got[0].time, before - 5ms);
  EXPECT_LE(got[0].time, after + 5ms);
}

TEST_F(OwnSync, IsTheOnlyOwnFrameThatIsReceived) {
  ASSERT_TRUE(bus.send(std::array{numbered(1), can::encode_sync()}).has_value());
  const auto got = read(bus, 1);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_TRUE(got[0].echo);
}

TEST_F(OwnSync, IsDistinguishedFromThatOfAnotherProgram) {
  ASSERT_TRUE(other.send(can::encode_sync()));
  const auto got = read(bus, 1);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_FALSE(got[0].echo);
}

struct KernelSync : OwnSync {};

TEST_F(KernelSync, ComesBackAsAnEcho) {
  ASSERT_TRUE(bus.start_sync(2ms).has_value());
  const auto got = read(bus, 20);
  ASSERT_GE(got.size(), 20u);
  for (const auto& received : got) {
    EXPECT_TRUE(received.echo);
    EXPECT_TRUE(can::decode_sync(received.frame).has_value());
  }
  EXPECT_TRUE(can::decode_sync(other.receive(1000ms).value_or(can::CanFrame{})).has_value());
}

TEST_F(KernelSync, StopsOnRequest) {
  ASSERT_TRUE(bus.start_sync(1ms).has_value());
  ASSERT_GE(read(bus, 5).size(), 5u);
  bus.stop_sync();
  while (other.receive()) {
  }
  EXPECT_FALSE(other.receive(50ms).has_value());
}

TEST_F(KernelSync, OrdinaryFramesAreNoEchoes) {
  ASSERT_TRUE(bus.start_sync(1s).has_value());
  ASSERT_TRUE(other.send(numbered(1)));
  for (const auto& received : read(bus, 2)) {
    if (received.frame.id == 0x181) {
      EXPECT_FALSE(received.echo);
    }
  }
}

TEST_F(KernelSync, IsRefusedOnAnInterfaceThatIsDown) {
  vcan.down();
  const auto refused = bus.start_sync(1ms);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("Network is down"));
}

TEST(SocketCanWithout, NamesTheMissingInterface) {
  MonotonicTime time;
  SocketCanBus bus{{.interface = "can99"}, time};
  const auto refused = bus.open(kIds);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::SystemRefused);
  EXPECT_THAT(refused.error().text, HasSubstr("can99"));
  EXPECT_THAT(refused.error().text, HasSubstr("No such device"));
}

}  // namespace
}  // namespace abbe::tests

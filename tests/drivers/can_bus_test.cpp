#include <gtest/gtest.h>
#include <linux/can.h>

#include <cstring>

#include "abbe/drivers/can/linux_frame.hpp"
#include "abbe/drivers/can/socket_can_bus.hpp"
#include "abbe/drivers/can/udp_can_bus.hpp"
#include "encoder_peer.hpp"
#include "stamped_socket.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using can::FrameFlag;
using tests::EncoderPeer;

constexpr std::array<std::uint32_t, 2> kIds{0x181, 0x701};

/// A bus and a peer that know each other.
struct UdpLine {
  UdpLine() {
    EXPECT_TRUE(bus.open(kIds).has_value());
    const std::array hello{can::encode_sync()};
    EXPECT_TRUE(bus.send(hello).has_value());
    peer.serve({});
  }
  MonotonicTime time;
  EncoderPeer peer{std::span<const can::EncoderIdentity>{}};
  UdpCanBus bus{{.peer_port = peer.port()}, time};
  std::array<ReceivedFrame, 64> frames{};
};

TEST(UdpCanBus, BindsToAPortTheKernelChose) {
  UdpLine line;
  EXPECT_NE(line.bus.local_port(), 0);
  EXPECT_EQ(line.peer.syncs(), 1u);
  line.bus.close();
  EXPECT_EQ(line.bus.local_port(), 0);
}

TEST(UdpCanBus, DeliversOnlyTheIdentifiersAskedForAndErrorFrames) {
  UdpLine line;
  can::CanFrame error;
  error.set(FrameFlag::Error);
  error.id = 0x40;
  auto extended = can::standard_frame(0x181, {1});
  extended.set(FrameFlag::Extended);
  const std::array sent{can::standard_frame(0x180, {1}), can::standard_frame(0x181, {2}), extended,
                        error, can::standard_frame(0x701, {5})};
  line.peer.send(sent);
  const auto n = line.bus.read(line.frames, 1s);

  ASSERT_TRUE(n.has_value());
  ASSERT_EQ(n->frames, 3u);
  EXPECT_EQ(line.frames[0].frame, sent[1]);
  EXPECT_EQ(line.frames[1].frame, error);
  EXPECT_EQ(line.frames[2].frame, sent[4]);
}

TEST(UdpCanBus, DatesFramesBetweenSendingAndReading) {
  UdpLine line;
  const auto before = line.time.now();
  line.peer.send(std::array{can::standard_frame(0x181, {1})});
  ASSERT_EQ(line.bus.read(line.frames, 1s).value_or(CanRead{}).frames, 1u);
  EXPECT_LE(line.frames[0].time, line.time.now());
  EXPECT_GE(line.frames[0].time, before - 200us);  // two clocks are read one after the other
}

/// The kernel begins to stamp when one of its workers has got round to it: on a busy computer
/// milliseconds after the first socket asked for stamps. What comes before has none.
void wait_for_stamps(UdpLine& line) {
  constexpr int kMostDatagrams = 1'000'000;
  for (int i = 0; i < kMostDatagrams; ++i) {
    line.peer.send(std::array{can::standard_frame(0x181, {0})});
    ASSERT_EQ(line.bus.read(line.frames, 1s).value_or(CanRead{}).frames, 1u);
    if (!line.frames[0].time_widened) return;
  }
  FAIL() << "the kernel stamps nothing";
}

TEST(UdpCanBus, UsesTheStampOfEveryQueuedDatagram) {
  UdpLine line;
  ASSERT_NO_FATAL_FAILURE(wait_for_stamps(line));
  const auto widened = line.bus.counters().time_widened;
  for (std::uint8_t i = 0; i < 3; ++i) line.peer.send(std::array{can::standard_frame(0x181, {i})});
  std::size_t total = 0;

  while (total < 3) {
    const auto n = line.bus.read(std::span{line.frames}.subspan(total), 1s);
    ASSERT_TRUE(n.has_value());
    ASSERT_GT(n->frames, 0u);
    total += n->frames;
  }

  EXPECT_EQ(line.bus.counters().time_widened, widened);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_FALSE(line.frames[i].time_widened);
}

TEST(UdpCanBus, HandsOutALargeDatagramInPieces) {
  UdpLine line;
  const std::vector<can::CanFrame> many(150, can::standard_frame(0x181, {1, 2, 3}));
  line.peer.send(many);
  std::size_t total = 0;
  while (total < many.size()) {
    const auto n = line.bus.read(line.frames, 1s);
    ASSERT_TRUE(n.has_value());
    ASSERT_GT(n->frames, 0u);
    total += n->frames;
  }
  EXPECT_EQ(total, many.size());
}

TEST(UdpCanBus, CountsGarbageAndLostDatagrams) {
  UdpLine line;
  line.peer.send(std::array{can::standard_frame(0x181, {1})});
  line.peer.skip_sequence(3);
  line.peer.send_bytes(std::as_bytes(std::span{"no CAN at all"}));
  line.peer.send(std::array{can::standard_frame(0x181, {2})});
  std::size_t total = 0;

  while (total < 2) {
    const auto n = line.bus.read(line.frames, 1s);
    ASSERT_TRUE(n.has_value());
    ASSERT_GT(n->frames, 0u);
    total += n->frames;
  }

  EXPECT_EQ(line.bus.counters().refused, 1u);
  EXPECT_EQ(line.bus.counters().lost, 3u);
}

TEST(UdpCanBus, ReportsWhetherTheQueueIsEmpty) {
  UdpLine line;
  line.peer.send(std::array{can::standard_frame(0x182, {1})});  // not asked for

  EXPECT_TRUE(line.bus.read(line.frames, 1s).value_or(CanRead{}).all);
  for (int i = 0; i < 64; ++i) line.peer.send_bytes(std::as_bytes(std::span{"no CAN at all"}));
  line.peer.send(std::array{can::standard_frame(0x181, {2})});
  const auto garbage = line.bus.read(line.frames, 1s);
  ASSERT_TRUE(garbage.has_value());
  EXPECT_EQ(garbage->frames, 0u);
  EXPECT_FALSE(garbage->all) << "a frame waits behind it";
  const auto rest = line.bus.read(line.frames, 1s);
  ASSERT_TRUE(rest.has_value());
  EXPECT_EQ(rest->frames, 1u);
  EXPECT_TRUE(rest->all);
}

TEST(UdpCanBus, AFullOutputBufferIsNotTheEnd) {
  UdpLine line;
  line.peer.send(
      std::vector<can::CanFrame>(line.frames.size() + 1, can::standard_frame(0x181, {1})));
  const auto full = line.bus.read(line.frames, 1s);
  ASSERT_TRUE(full.has_value());
  EXPECT_EQ(full->frames, line.frames.size());
  EXPECT_FALSE(full->all);
}

TEST(UdpCanBus, ReportsThatANameHasNoAddress) {
  MonotonicTime time;
  const std::string no_name(300, 'x');  // longer than any name may be: no name server is asked
  UdpCanBus bus{{.peer_address = no_name, .peer_port = 1}, time};
  const auto refused = bus.open(kIds);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::Unreachable);
  EXPECT_THAT(refused.error().text, testing::HasSubstr("no address"));
}

TEST(UdpCanBus, RefusesAPeerWithoutHostOrPort) {
  MonotonicTime time;
  for (const UdpCanOptions& options :
       {UdpCanOptions{.peer_port = 0}, UdpCanOptions{.peer_address = "", .peer_port = 1}}) {
    const auto refused = UdpCanBus{options, time}.open(kIds);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::BadConfiguration);
  }
}

TEST(UdpCanBus, LooksUpTheNameOfItsPeer) {
  MonotonicTime time;
  EncoderPeer peer{std::span<const can::EncoderIdentity>{}};
  UdpCanBus bus{{.peer_address = "localhost", .peer_port = peer.port()}, time};
  const auto opened = bus.open(kIds);
  ASSERT_TRUE(opened.has_value()) << opened.error().text;
  const std::array hello{can::encode_sync()};
  EXPECT_TRUE(bus.send(hello).has_value());
  peer.serve({});
  EXPECT_EQ(peer.syncs(), 1u);
}

TEST(UdpCanBus, ReachesAPeerOnAnotherComputer) {
  MonotonicTime time;
  UdpCanBus bus{{.peer_address = "192.0.2.1", .peer_port = 20000},
                time};  // reserved for examples [RFC 5737]
  const auto opened = bus.open(kIds);
  if (!opened && opened.error().text.find(std::strerror(ENETUNREACH)) != std::string::npos)
    GTEST_SKIP() << "no network here";
  EXPECT_TRUE(opened.has_value()) << opened.error().text;
}

/// Of another process than the peer, connected to where the bus receives.
int socket_to(const drivers::UdpCanBus& bus) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  to.sin_port = htons(bus.local_port());
  EXPECT_EQ(::connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
  return fd;
}

TEST(UdpCanBus, ReceivesFromItsPeerOnly) {
  UdpLine line;
  const int stranger = socket_to(line.bus);
  EXPECT_GT(::send(stranger, "no", 2, 0), 0);
  sockaddr_in from{};
  socklen_t size = sizeof from;
  ::getsockname(stranger, reinterpret_cast<sockaddr*>(&from), &size);
  ::close(stranger);
  line.peer.send(std::array{can::standard_frame(0x181, {1})});
  EXPECT_EQ(line.bus.read(line.frames, 1s).value_or(CanRead{}).frames, 1u);
  EXPECT_EQ(line.bus.counters().refused, 0u);
  EXPECT_EQ(line.bus.counters().foreign_datagrams, 1u);
  EXPECT_EQ(line.bus.foreign_sender(), "127.0.0.1:" + std::to_string(ntohs(from.sin_port)));
}

TEST(UdpCanBus, DatagramsOfOtherSendersTakeNoSpaceFromThoseOfThePeer) {
  UdpLine line;
  const int stranger = socket_to(line.bus);
  const std::vector<char> big(8192);
  for (int i = 0; i < 500; ++i)  // more than any receive buffer holds
    ::send(stranger, big.data(), big.size(), MSG_DONTWAIT);
  ::close(stranger);
  line.peer.send(std::array{can::standard_frame(0x181, {1})});
  EXPECT_EQ(line.bus.read(line.frames, 1s).value_or(CanRead{}).frames, 1u);
  EXPECT_GT(line.bus.counters().foreign_datagrams, 0u);
  EXPECT_EQ(line.bus.counters().lost, 0u);
}

TEST(UdpCanBus, NamesThePortThatIsInUse) {
  MonotonicTime time;
  EncoderPeer holder{std::span<const can::EncoderIdentity>{}};
  UdpCanBus bus{{.local_port = holder.port(), .peer_port = 9}, time};
  const auto refused = bus.open(kIds);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::SystemRefused);
  EXPECT_THAT(refused.error().text, testing::HasSubstr(std::to_string(holder.port())));
}

TEST(LinuxFrame, RoundTripsEveryKindOfFrame) {
  auto fd = can::standard_frame(0x181, {1, 2, 3});
  fd.set(FrameFlag::Fd);
  fd.fd_flags = CANFD_BRS;
  fd.length = 64;
  auto extended = can::standard_frame(0, {9});
  extended.set(FrameFlag::Extended);
  extended.id = 0x1ABCDEF0;
  auto remote = can::standard_frame(0x123, {0, 0, 0});
  remote.set(FrameFlag::Remote);
  can::CanFrame error;
  error.set(FrameFlag::Error);
  error.id = 0x1FF;
  error.length = 8;

  for (const auto& frame :
       {can::standard_frame(0x605, {0x40, 4, 0x60, 0, 0, 0, 0, 0}), fd, extended, remote, error}) {
    const auto out = to_linux(frame);
    EXPECT_EQ(from_linux(out.frame, out.size), frame);
  }
}

TEST(LinuxFrame, ReadsNothingFromShortReadsAndCutsWildLengths) {
  canfd_frame wild{};
  wild.len = 255;
  EXPECT_FALSE(from_linux(wild, 7));
  EXPECT_EQ(from_linux(wild, CAN_MTU)->length, 8);
  EXPECT_EQ(from_linux(wild, CANFD_MTU)->length, 64);
}

TEST(LinuxFrame, FiltersMatchExactlyTheDataFramesAskedFor) {
  const auto filters = filters_for(kIds);
  ASSERT_EQ(filters.size(), kIds.size());
  const auto passes = [&](canid_t id) {
    return (id & filters[0].can_mask) == (filters[0].can_id & filters[0].can_mask);
  };
  EXPECT_TRUE(passes(0x181));
  EXPECT_FALSE(passes(0x182));
  EXPECT_FALSE(passes(0x181 | CAN_RTR_FLAG));
  EXPECT_FALSE(passes(0x181 | CAN_EFF_FLAG));
}

TEST(SocketCanBus, ReportsWhatTheSystemRefused) {
  MonotonicTime time;
  SocketCanBus bus{{.interface = "nocan99"}, time};
  const auto opened = bus.open(kIds);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::SystemRefused);
  EXPECT_THAT(opened.error().text, testing::HasSubstr("nocan99"));
}

/// On a machine with a virtual CAN interface: ip link add dev vcan0 type vcan; ip link set vcan0
/// up.
TEST(SocketCanBus, CarriesFramesOverVcan) {
  MonotonicTime time;
  SocketCanBus receiver{{.interface = "vcan0"}, time};
  SocketCanBus sender{{.interface = "vcan0"}, time};
  if (const auto opened = receiver.open(kIds); !opened)
    GTEST_SKIP() << "no CAN here: " << opened.error().text;
  ASSERT_TRUE(sender.open({}).has_value());
  auto fd = can::standard_frame(0x701, {1});
  fd.set(FrameFlag::Fd);
  const std::array sent{can::standard_frame(0x181, {1, 2}), can::standard_frame(0x182, {3}), fd};
  const auto before = time.now();
  ASSERT_TRUE(sender.send(sent).has_value());
  std::array<ReceivedFrame, 8> frames{};
  std::size_t total = 0;

  while (total < 2) {
    const auto n = receiver.read(std::span{frames}.subspan(total), 1s);
    ASSERT_TRUE(n.has_value());
    ASSERT_GT(n->frames, 0u);
    total += n->frames;
  }

  EXPECT_EQ(frames[0].frame, sent[0]);
  EXPECT_EQ(frames[1].frame, fd);
  EXPECT_GE(frames[0].time, before - 200us);
}

}  // namespace
}  // namespace abbe::drivers

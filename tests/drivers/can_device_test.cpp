#include <gtest/gtest.h>

#include <algorithm>

#include "abbe/drivers/device_thread.hpp"
#include "encoder_device_on_udp.hpp"
#include "stepped_time.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using can::EncoderIdentity;
using protocol::AxisSample;
using protocol::RawBlock;
using protocol::SampleFlag;
using tests::EncoderPeer;

TEST_F(EncoderDeviceOnUdp, ConfiguresAllNodesAndStreams) {
  begin_streaming();
  EXPECT_TRUE(device->status().connected);
  EXPECT_EQ(device->status().faults, 0u);
  for (const std::size_t i : {0u, 1u}) {
    EXPECT_EQ(peer.node(i).objects.tpdo(1).transmission_type, 1);
    EXPECT_FALSE(peer.node(i).objects.tpdo(2).enabled);
    EXPECT_EQ(peer.node(i).state, can::NodeState::Operational);
  }
}

TEST_F(EncoderDeviceOnUdp, GivesPositionsInMetresByTheStepOfTheEncoder) {
  begin_streaming();
  peer.move_to(123456);
  turns(8);
  EXPECT_EQ(samples.back().count[1], 123456);
  EXPECT_DOUBLE_EQ(samples.back().position[1], 123456 * 10e-9);
}

TEST_F(EncoderDeviceOnUdp, SendsTheSyncOnItsGridWithoutDrift) {
  begin_streaming();
  turns(100);
  ASSERT_GT(samples.size(), 20u);
  for (std::size_t i = 1; i < samples.size(); ++i)
    EXPECT_EQ(samples[i].head.time - samples[i - 1].head.time, 4ms);
}

TEST_F(EncoderDeviceOnUdp, LeavesOutSyncsItCannotServeAndStaysOnTheGrid) {
  begin_streaming();
  turns(8);
  const auto before = samples.back().head.time;
  time.advance(13ms);  // the thread was not scheduled
  turns(12);
  const auto gap = std::find_if(samples.begin(), samples.end(), [](const auto& s) {
    return has(s.head.flags, SampleFlag::GapBefore);
  });
  ASSERT_NE(gap, samples.end());
  EXPECT_GT(gap->head.lost_before, 0u);
  EXPECT_GT(device->status().gaps, 0u);
  EXPECT_EQ((samples.back().head.time - before) % 4ms, 0ns);
}

TEST_F(EncoderDeviceOnUdp, GoesOnWithTheOtherAxisWhenOneIsMute) {
  begin_streaming();
  peer.node(1).mute = true;

  ASSERT_TRUE(state_becomes("degraded"));
  ASSERT_TRUE(cycles_until([&] { return device->status().faults > 0; }));
  EXPECT_THAT(device->status().last_fault, testing::HasSubstr("encoder Y (node 2)"));
  samples.clear();
  turns(20);
  ASSERT_FALSE(samples.empty());
  EXPECT_EQ(samples.back().missing_mask, 0b10);
  peer.node(1).mute = false;
  ASSERT_TRUE(state_becomes("streaming"));
  turns(10);
  EXPECT_EQ(samples.back().missing_mask, 0);
}

TEST_F(EncoderDeviceOnUdp, ReconfiguresANodeThatRebooted) {
  begin_streaming();
  peer.restart();
  EXPECT_NE(peer.node(0).objects.tpdo(1).transmission_type, 1);
  ASSERT_TRUE(cycles_until([&] {
    return std::any_of(samples.begin(), samples.end(),
                       [](const auto& s) { return has(s.head.flags, SampleFlag::Restarted); });
  }));
  ASSERT_TRUE(state_becomes("streaming"));
  EXPECT_EQ(peer.node(0).objects.tpdo(1).transmission_type, 1);
}

TEST_F(EncoderDeviceOnUdp, ReconfiguresANodeThatIsNotOperational) {
  begin_streaming();
  peer.node(0).state = can::NodeState::PreOperational;
  ASSERT_TRUE(cycles_until([&] { return peer.node(0).state == can::NodeState::Operational; }));
  ASSERT_TRUE(state_becomes("streaming"));
}

TEST_F(EncoderDeviceOnUdp, RefusesADeviceOfAnotherTypeByName) {
  peer.node(1).objects.set_number(can::object::kDeviceType, 0x00020192);
  ASSERT_TRUE(state_becomes("degraded"));
  EXPECT_THAT(device->status().last_fault,
              testing::AllOf(testing::HasSubstr("encoder Y (node 2)"),
                             testing::HasSubstr("no encoder"), testing::HasSubstr("00020192")));
}

TEST_F(EncoderDeviceOnUdp, RefusesAnEncoderWhoseStepIsZero) {
  peer.node(0).objects.set_number(can::object::kPositionStep, 0);
  peer.node(0).objects.set_number(can::object::kMeasuringStep, 0);
  ASSERT_TRUE(state_becomes("degraded"));
  EXPECT_THAT(device->status().last_fault, testing::HasSubstr("encoder X (node 1)"));
  EXPECT_THAT(device->status().last_fault, testing::HasSubstr("no measuring step"));
}

TEST_F(EncoderDeviceOnUdp, ReportsAMuteNodeOnceNotEveryRetry) {
  peer.node(1).mute = true;
  ASSERT_TRUE(state_becomes("degraded"));
  turns(8000);
  EXPECT_EQ(device->status().faults, 1u);
}

TEST_F(EncoderDeviceOnUdp, ADelayedThreadReconfiguresNoNode) {
  begin_streaming();
  turns(200);
  const auto nmt = peer.nmt().size();
  const auto faults = device->status().faults;
  samples.clear();

  for (int i = 0; i < 5; ++i) {
    peer.serve(time.now());
    peer.answer_sync();
    time.advance(500ms);
    turns(kCyclesPerSync + i);
  }

  turns(40);
  EXPECT_EQ(peer.nmt().size(), nmt);
  EXPECT_EQ(device->status().faults, faults) << device->status().last_fault;
  EXPECT_EQ(device->status().state, "streaming");
  for (const auto& sample : samples) EXPECT_FALSE(has(sample.head.flags, SampleFlag::DeviceError));
}

TEST_F(EncoderDeviceOnUdp, ReportsANodeThatSendsEmcyAndDropsOut) {
  begin_streaming();
  const auto nmt = peer.nmt().size();
  for (int i = 0; i < 10'000; ++i) {
    if (i % 100 == 0)
      peer.send(
          std::array{can::encode_emergency({.node = 1, .code = 0x8130, .error_register = 0x11})});
    peer.serve(time.now());
    peer.node(0).state = can::NodeState::PreOperational;
    cycle();
    if (i < 1000) continue;
    ASSERT_EQ(device->status().state, "degraded");
  }

  EXPECT_EQ(samples.back().missing_mask, 0b01);
  EXPECT_THAT(
      device->status().condition,
      testing::AllOf(testing::HasSubstr("X missing (node 1)"), testing::HasSubstr("EMCY 8130h"),
                     testing::HasSubstr("heartbeat"), testing::Not(testing::HasSubstr("node 2"))));
  EXPECT_THAT(device->status().last_fault, testing::AllOf(testing::HasSubstr("encoder X (node 1)"),
                                                          testing::HasSubstr("EMCY 8130h")));
  EXPECT_LT(peer.nmt().size() - nmt, 30u) << "configured again once a second, not without a pause";
}

TEST_F(EncoderDeviceOnUdp, ReportsANodeThatLeavesOperationalByItself) {
  begin_streaming();
  turns(1500);
  peer.node(0).state = can::NodeState::PreOperational;
  ASSERT_TRUE(cycles_until([&] { return device->status().faults > 0; }));
  EXPECT_THAT(device->status().last_fault, testing::AllOf(testing::HasSubstr("encoder X (node 1)"),
                                                          testing::HasSubstr("pre-operational")));
  ASSERT_TRUE(cycles_until(
      [&] { return device->status().condition.empty() && samples.back().missing_mask == 0; }));
}

TEST_F(EncoderDeviceOnUdp, UsesTheMappingOfAnEncoderThatCannotBeMapped) {
  const std::array count{std::byte{2}};
  const std::array speed{std::byte{0x10}, std::byte{1}, std::byte{0x30}, std::byte{0x60}};
  const std::array place{std::byte{0x20}, std::byte{0}, std::byte{0x04}, std::byte{0x60}};
  auto& objects = peer.node(0).objects;
  objects.add({0x1A00, 0}, can::Access::ReadOnly, count);
  objects.add({0x1A00, 1}, can::Access::ReadOnly, speed);
  objects.add({0x1A00, 2}, can::Access::ReadOnly, place);
  peer.move_to(123456);
  begin_streaming();
  turns(20);

  EXPECT_EQ(samples.back().count[0], 123456);
  EXPECT_EQ(samples.back().count[1], 123456);
  expect_the_same_from_raw_bytes();
}

TEST_F(EncoderDeviceOnUdp, AsksAgainWhereTheMappingIsRefusedForTheMoment) {
  constexpr std::uint32_t kSpeed = 0x60300110;
  for (const auto code : {can::AbortCode::DeviceState, can::AbortCode::CannotStore}) {
    for (const std::uint8_t sub : {std::uint8_t{0}, std::uint8_t{1}}) {
      SCOPED_TRACE(int{sub});
      peer.node(0).objects.reset();
      peer.node(0).objects.set_number({0x1A00, 1}, kSpeed);
      peer.node(0).refuses = {{0x1A00, sub}, code};
      device = std::move(*EncoderDevice::create({.receiver = two_axes()}, make_bus(), time));
      ASSERT_TRUE(cycles_until([&] { return device->status().faults > 0; }));
      EXPECT_THAT(
          device->status().last_fault,
          testing::AllOf(testing::HasSubstr("encoder X (node 1)"), testing::HasSubstr("refuses")));
      turns(3000);
      EXPECT_EQ(device->status().faults, 1u) << "however often it is asked";
      peer.node(0).refuses.reset();
      EXPECT_TRUE(state_becomes("streaming")) << device->status().last_fault;
    }
  }
}

TEST_F(EncoderDeviceOnUdp, ALastingRefusalOfTheMappingIsFinal) {
  peer.node(0).objects.set_number({0x1A00, 1}, 0x60300110);
  peer.node(0).refuses = {{0x1A00, 1}, can::AbortCode::NotMappable};
  ASSERT_TRUE(cycles_until([&] { return device->status().faults > 0; }));
  peer.node(0).refuses.reset();
  turns(5000);
  EXPECT_EQ(device->status().state, "degraded")
      << "not asked again before it was switched off and on";
}

TEST_F(EncoderDeviceOnUdp, RefusesAnEncoderOfAnotherStepOnceWithBothValues) {
  EncoderDeviceOptions options;
  options.receiver = two_axes();
  options.receiver.axes[0].scale = 10e-9;
  device = std::move(*EncoderDevice::create(options, make_bus(), time));
  peer.node(0).objects.set_number(can::object::kPositionStep, 20);

  ASSERT_TRUE(cycles_until([&] { return device->status().faults > 0; }));
  EXPECT_THAT(device->status().last_fault,
              testing::AllOf(testing::HasSubstr("encoder X (node 1)"), testing::HasSubstr("20 nm"),
                             testing::HasSubstr("step_nm = 10")));
  turns(8000);
  EXPECT_EQ(device->status().faults, 1u);
  EXPECT_EQ(std::ranges::count(peer.nmt(), 1, &can::NmtMessage::node), 1) << "not asked again";
  EXPECT_EQ(device->status().state, "degraded");
}

TEST_F(EncoderDeviceOnUdp, ReportsATunnelThatHoldsFramesBack) {
  begin_streaming();
  std::vector<can::CanFrame> held;
  for (int i = 0; i < 3000; ++i) {
    peer.serve(time.now());
    const auto frames = peer.take_answer();
    held.insert(held.end(), frames.begin(), frames.end());
    if (i % 100 == 99) {
      peer.send(held);
      held.clear();
    }
    device->wait(kCycle);
    device->receive();
    time.advance(kCycle);
  }

  EXPECT_EQ(device->status().state, "degraded");
  EXPECT_THAT(device->status().last_fault,
              testing::AllOf(testing::HasSubstr("bundles"), testing::HasSubstr("cannelloni")));
}

TEST_F(EncoderDeviceOnUdp, ReportsAnswersThatComeAfterTheirCycle) {
  begin_streaming();
  for (int i = 0; i < 3000; ++i) {
    peer.serve(time.now());
    if (const auto late = peer.take_answer(); !late.empty()) {
      time.advance(3ms);  // 3.5 ms after the SYNC, 0.3 ms after the end of the cycle
      peer.send(late);
    }
    device->wait(kCycle);
    device->receive();
    time.advance(500us);
  }

  EXPECT_EQ(device->status().state, "degraded");
  EXPECT_THAT(device->status().last_fault, testing::HasSubstr("after the end of their cycle"));
}

TEST_F(EncoderDeviceOnUdp, ReportsOtherSendersOnItsPort) {
  begin_streaming();
  const int stranger = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  to.sin_port = htons(bus->local_port());
  std::array<std::byte, 64> buffer{};
  can::DatagramWriter writer{buffer, 0};

  ASSERT_TRUE(writer.add(can::encode_position(0x181, can::PositionType::Signed32, 99'999'999)));
  const auto fake = writer.finish();
  for (int i = 0; i < 200; ++i) {
    ::sendto(stranger, fake.data(), fake.size(), 0, reinterpret_cast<const sockaddr*>(&to),
             sizeof to);
    cycle();
  }
  ::close(stranger);
  for (const auto& sample : samples) EXPECT_LT(sample.count[0], 1000);
  EXPECT_EQ(device->status().state, "streaming");
  EXPECT_THAT(device->status().last_fault,
              testing::AllOf(testing::HasSubstr("127.0.0.1:"), testing::HasSubstr("not the peer")));
}

TEST_F(EncoderDeviceOnUdp, CountsDatagramsThatAreMissing) {
  begin_streaming();
  const auto before = device->status().gaps;
  peer.skip_sequence(5);
  turns(10);
  EXPECT_EQ(device->status().gaps, before + 5);
}

TEST_F(EncoderDeviceOnUdp, CountsPositionsThatAreTooShortAsFaults) {
  begin_streaming();
  const auto before = device->status().faults;
  const std::vector<can::CanFrame> shorts(3, can::standard_frame(0x181, {1, 2}));
  peer.send(shorts);
  turns(10);
  EXPECT_EQ(device->status().faults, before + 3);
  EXPECT_THAT(device->status().last_fault, testing::HasSubstr("too short"));
}

TEST_F(EncoderDeviceOnUdp, ReportsANodeThatAnswersTwiceInACycle) {
  begin_streaming();
  const auto before = device->status().faults;
  peer.send(std::array{can::encode_position(0x182, can::PositionType::Signed32, 5)});
  turns(12);
  EXPECT_EQ(std::ranges::count(samples, 0b10, &AxisSample::missing_mask), 1);
  EXPECT_EQ(samples.back().missing_mask, 0);
  EXPECT_EQ(device->status().faults, before + 1);
  EXPECT_THAT(device->status().last_fault, testing::HasSubstr("second answers in a cycle"));
}

TEST_F(EncoderDeviceOnUdp, RefusesASyncThatOnlyTheKernelCouldSend) {
  EncoderDeviceOptions options;
  options.receiver.axes = {{.name = "X", .node = 1}};
  options.sync = SyncSource::Kernel;
  const auto refused = EncoderDevice::create(
      options, std::make_unique<UdpCanBus>(UdpCanOptions{.peer_port = peer.port()}, time), time);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::BadConfiguration);
  EXPECT_THAT(refused.error().text, testing::HasSubstr("SocketCAN"));
}

TEST_F(EncoderDeviceOnUdp, KeepsStreamingDuringAFloodOfPositions) {
  begin_streaming();
  const std::vector<can::CanFrame> flood(
      4000, can::encode_position(0x181, can::PositionType::Signed32, 5));
  peer.send(flood);
  turns(40);
  EXPECT_EQ(samples.back().missing_mask, 0);
  EXPECT_EQ(device->status().state, "streaming");
}

TEST_F(EncoderDeviceOnUdp, ReplaysItsRawBytesToTheSameSamples) {
  begin_streaming();
  peer.node(1).mute = true;
  turns(50);
  peer.node(1).mute = false;
  peer.move_to(-77);
  turns(1000);
  peer.send(std::array{can::encode_position(0x181, can::PositionType::Signed32, 5)});
  turns(1000);
  expect_the_same_from_raw_bytes();
}

TEST(EncoderDevice, StreamsInItsOwnThreadOnTheRealClock) {
  const std::array identities{EncoderIdentity{.node = 1}, EncoderIdentity{.node = 2}};
  EncoderPeer peer{identities};
  MonotonicTime time;
  EncoderDeviceOptions options;
  options.receiver.axes = {{.name = "X", .node = 1}, {.name = "Y", .node = 2}};
  auto device = EncoderDevice::create(
      options, std::make_unique<UdpCanBus>(UdpCanOptions{.peer_port = peer.port()}, time), time);
  ASSERT_TRUE(device.has_value());
  auto thread = DeviceThread::start(**device, {.name = "encoders"});
  ASSERT_TRUE(thread.has_value());
  std::vector<AxisSample> complete;
  const auto give_up = time.now() + 60s;

  while (complete.size() < 50 && time.now() < give_up) {
    peer.wait(1);
    peer.serve(time.now());
    peer.answer_sync();
    std::array<AxisSample, 16> out{};
    const auto n = (*device)->samples().pop(out);
    std::copy_if(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n),
                 std::back_inserter(complete),
                 [](const AxisSample& s) { return s.missing_mask == 0; });
    EXPECT_EQ((*device)->status().name, "encoders");
  }

  (*thread)->stop();
  EXPECT_FALSE((*thread)->failure());
  ASSERT_GE(complete.size(), 50u) << (*device)->status().last_fault;
  for (std::size_t i = 1; i < complete.size(); ++i)
    EXPECT_LT(complete[i - 1].head.time, complete[i].head.time);
}

TEST(EncoderDevice, RefusesABadConfiguration) {
  tests::SteppedTime time;
  EXPECT_FALSE(EncoderDevice::create({}, std::make_unique<UdpCanBus>(UdpCanOptions{}, time), time));
}

TEST(EncoderDevice, ReportsThatThePeerDoesNotListenAndKeepsTrying) {
  tests::SteppedTime time;
  std::uint16_t port = 0;
  {
    port = EncoderPeer{std::span<const EncoderIdentity>{}}.port();
  }  // closed again: no peer listens
  EncoderDeviceOptions options;
  options.receiver.axes = {{.name = "X", .node = 1}};
  auto device = EncoderDevice::create(
      options, std::make_unique<UdpCanBus>(UdpCanOptions{.peer_port = port, .speed = 0.0}, time),
      time);
  ASSERT_TRUE(device.has_value());

  for (int i = 0; i < 3000; ++i) {
    (*device)->wait(1ms);
    (*device)->receive();
    time.advance(1ms);
  }

  const auto status = (*device)->status();
  EXPECT_FALSE(status.connected);
  EXPECT_EQ(status.samples, 0u);
  EXPECT_GE(status.faults, 1u);
}

}  // namespace
}  // namespace abbe::drivers

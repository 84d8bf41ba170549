#include <gtest/gtest.h>

#include "../encoder_peer.hpp"
#include "abbe/drivers/can/encoder_device.hpp"
#include "abbe/drivers/can/udp_can_bus.hpp"
#include "abbe/protocol/can/error_frame.hpp"
#include "rt_guards.hpp"
#include "stepped_time.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;

EncoderReceiverOptions two_axes() {
  EncoderReceiverOptions options;
  options.axes = {{.name = "X", .node = 1, .scale = 1e-8}, {.name = "Y", .node = 2}};
  return options;
}

/// Every kind of frame on the bus, cycle after cycle, an axis missing in every third, a second
/// answer in every fifth. A held sample leaves with the next SYNC, or without it.
void cycle(EncoderReceiver& receiver, std::size_t i) ABBE_RT {
  const HostTime t{1h + 1ms * i};
  const auto count = static_cast<std::int64_t>(i * 1000);
  (void)receiver.on_sent(can::encode_sync(), t);
  (void)receiver.on_frame(can::encode_position(0x181, can::PositionType::Signed32, count),
                          t + 100us);
  (void)receiver.on_frame(can::encode_heartbeat(1, can::NodeState::Operational), t + 110us);
  (void)receiver.on_frame(can::standard_frame(0x582, {0x43, 0x05, 0x60, 1, 10, 0, 0, 0}),
                          t + 120us);
  (void)receiver.on_frame(can::encode_emergency({.node = 2, .code = 0x5000}), t + 130us);
  if (i % 7 == 0) {
    const auto off = static_cast<can::BusConditions>(can::BusCondition::BusOff);
    (void)receiver.on_frame(can::encode_error_frame({.conditions = off}), t + 140us);
  }
  if (i % 3 != 0)
    (void)receiver.on_frame(can::encode_position(0x182, can::PositionType::Signed32, -count),
                            t + 200us);
  if (i % 5 == 0)
    (void)receiver.on_frame(can::encode_position(0x181, can::PositionType::Signed32, count),
                            t + 300us);
  (void)receiver.on_time(t + 900us);
  if (i % 2 != 0) (void)receiver.on_time(t + 1ms);
}

TEST(EncoderReceiverRt, TakesNoMemory) {
  EncoderReceiver receiver{two_axes()};
  tests::expect_no_allocation(10'000, [&](std::size_t i) { cycle(receiver, i); });
  EXPECT_GE(receiver.counters().samples, 10'000u);
}

TEST(EncoderReceiverRt, MakesNoSystemCall) {
  EncoderReceiver receiver{two_axes()};
  tests::expect_no_system_call([&] {
    for (std::size_t i = 0; i < 100; ++i) cycle(receiver, i);
  });
}

/// The whole of receive(): raw blocks, samples and status too. wait() stands outside the guards.
TEST(EncoderDeviceRt, ReceiveTakesNoMemory) {
  tests::SteppedTime time;
  tests::EncoderPeer peer{
      std::array{can::EncoderIdentity{.node = 1}, can::EncoderIdentity{.node = 2}}};
  EncoderDeviceOptions options;
  options.receiver = two_axes();
  options.receiver.sync_period = 4ms;
  auto bus =
      std::make_unique<UdpCanBus>(UdpCanOptions{.peer_port = peer.port(), .speed = 0.0}, time);
  auto device = EncoderDevice::create(options, std::move(bus), time);
  ASSERT_TRUE(device.has_value());
  std::uint64_t allocations = 0;

  for (int i = 0; i < 4000; ++i) {
    peer.serve(time.now());
    if (i % 50 != 0) peer.answer_sync();
    (*device)->wait(1ms);
    const tests::AllocationCount count;
    (*device)->receive();
    allocations += count.value();
    time.advance(1ms);
  }

  EXPECT_EQ(allocations, 0u);
  EXPECT_GT((*device)->status().samples, 500u);
}

}  // namespace
}  // namespace abbe::drivers

// The encoder device while the controller of the CAN bus is off, and after it has restarted.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <span>

#include "abbe/protocol/can/error_frame.hpp"
#include "encoder_device_on_udp.hpp"

namespace abbe::drivers {
namespace {

using protocol::SampleFlag;

TEST_F(EncoderDeviceOnUdp, ReportsBusOffAndStopsTheSync) {
  begin_streaming();
  const std::array off{can::encode_error_frame(
      {.conditions = static_cast<can::BusConditions>(can::BusCondition::BusOff)})};
  peer.send(off);
  ASSERT_TRUE(state_becomes("bus off"));
  EXPECT_FALSE(device->status().connected);
  EXPECT_TRUE(has(samples.back().head.flags, SampleFlag::BusOff));
  EXPECT_EQ(samples.back().missing_mask, 0b11);
}

TEST_F(EncoderDeviceOnUdp, ResetsAndReconfiguresTheNodesAfterBusOff) {
  begin_streaming();
  const auto before = peer.nmt().size();
  send_condition(can::BusCondition::BusOff);
  send_condition(can::BusCondition::Restarted);
  turns(3);
  const auto resets = std::ranges::count(peer.nmt(), can::NmtCommand::ResetCommunication,
                                         &can::NmtMessage::command);

  EXPECT_EQ(resets, 2);
  samples.clear();
  ASSERT_TRUE(state_becomes("streaming"));
  ASSERT_TRUE(cycles_until([&] { return !samples.empty() && samples.back().missing_mask == 0; }));
  for (const auto& message : std::span{peer.nmt()}.subspan(before))
    EXPECT_THAT(message.node, testing::AnyOf(1, 2)) << "the drives on this bus are not ours";
}

TEST_F(EncoderDeviceOnUdp, ListensAgainAfterALongBusOff) {
  begin_streaming();
  bus_is_off_for(2100);  // longer than ForeignSync::kShortBreak
  const auto before = peer.nmt().size();
  send_condition(can::BusCondition::Restarted);
  turns(1400);
  EXPECT_EQ(device->status().state, "listening");
  EXPECT_EQ(peer.nmt().size(), before) << "a master that came meanwhile has configured the nodes";
  samples.clear();
  ASSERT_TRUE(state_becomes("streaming"));
  ASSERT_TRUE(cycles_until([&] { return !samples.empty() && samples.back().missing_mask == 0; }));
}

TEST_F(EncoderDeviceOnUdp, SendsNothingIfAnotherSyncProducerStartedDuringBusOff) {
  begin_streaming();
  bus_is_off_for(2100);
  const auto before = peer.nmt().size();
  send_condition(can::BusCondition::Restarted);
  for (int i = 0; i < 4; ++i) {
    turns(999);
    peer.send(std::array{can::encode_sync()});
  }
  turns(1000);
  EXPECT_EQ(device->status().state, "foreign SYNC");
  EXPECT_EQ(peer.nmt().size(), before);
}

TEST_F(EncoderDeviceOnUdp, SilenceDuringBusOffDoesNotCountAsAQuietBus) {
  turns(100);
  ASSERT_EQ(device->status().state, "listening");
  peer.talk_to(bus->local_port());
  bus_is_off_for(1500);
  send_condition(can::BusCondition::Restarted);
  turns(1400);
  EXPECT_EQ(device->status().state, "listening");
  EXPECT_TRUE(state_becomes("streaming")) << device->status().last_fault;
}

TEST_F(EncoderDeviceOnUdp, ConfiguresNodesThatLostPowerWhileTheBusWasOffAndClosed) {
  begin_streaming();
  send_condition(can::BusCondition::BusOff);
  ASSERT_TRUE(state_becomes("bus off"));
  bus->fail_next_read();
  peer.restart();
  device->wait(kCycle);  // fails: closed
  device->receive();
  EXPECT_EQ(device->status().state, "closed");
  samples.clear();
  ASSERT_TRUE(state_becomes("streaming")) << device->status().state;
  ASSERT_TRUE(cycles_until([&] { return !samples.empty() && samples.back().missing_mask == 0; }));
}

}  // namespace
}  // namespace abbe::drivers

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/control_emergency.hpp"

#include <gtest/gtest.h>

#include "abbe/protocol/can/error_frame.hpp"
#include "abbe/protocol/can/pdo.hpp"

namespace abbe::protocol::can {
namespace {

TEST(CanFrame, GivesNoPayloadForRemoteFrames) {
  auto frame = standard_frame(0x185, {1, 2, 3, 4});
  frame.set(FrameFlag::Remote);
  EXPECT_EQ(frame.length, 4);
  EXPECT_TRUE(frame.payload().empty());
}

TEST(CanFrame, NeverReadsPastItsDataWhateverTheLength) {
  CanFrame frame;
  frame.length = 255;
  EXPECT_EQ(frame.payload().size(), CanFrame::kMaxData);
  EXPECT_EQ(frame.byte(200), 0);
}

TEST(Nmt, StartOfNodeFiveIsTwoBytesOnIdentifierZero) {
  EXPECT_EQ(encode_nmt(NmtCommand::Start, 5), standard_frame(0x000, {0x01, 0x05}));
  EXPECT_EQ(encode_nmt(NmtCommand::PreOperational, kAllNodes), standard_frame(0x000, {0x80, 0x00}));
  EXPECT_EQ(encode_nmt(NmtCommand::ResetCommunication, 127), standard_frame(0x000, {0x82, 0x7F}));
}

TEST(Nmt, RoundTripsEveryCommand) {
  for (const auto command : {NmtCommand::Start, NmtCommand::Stop, NmtCommand::PreOperational,
                             NmtCommand::ResetNode, NmtCommand::ResetCommunication}) {
    const auto message = decode_nmt(encode_nmt(command, 9));
    ASSERT_TRUE(message);
    EXPECT_EQ(message->command, command);
    EXPECT_EQ(message->node, 9);
  }
}

TEST(Nmt, RefusesUnknownCommandsNodesAndLengths) {
  EXPECT_FALSE(decode_nmt(standard_frame(0x000, {3, 5})));
  EXPECT_FALSE(decode_nmt(standard_frame(0x000, {1, 128})));
  EXPECT_FALSE(decode_nmt(standard_frame(0x000, {1})));
  EXPECT_FALSE(decode_nmt(standard_frame(0x001, {1, 5})));
}

TEST(Sync, IsEmptyOrOneCounterByte) {
  EXPECT_EQ(encode_sync(), standard_frame(0x080, {}));
  EXPECT_EQ(encode_sync(7), standard_frame(0x080, {7}));
  EXPECT_FALSE(decode_sync(encode_sync())->counter);
  EXPECT_EQ(decode_sync(encode_sync(240))->counter, 240);
  EXPECT_FALSE(decode_sync(standard_frame(0x080, {1, 2})));
}

TEST(Heartbeat, CarriesTheStateOfTheNode) {
  EXPECT_EQ(encode_heartbeat(5, NodeState::Operational), standard_frame(0x705, {0x05}));
  const auto boot_up = decode_heartbeat(standard_frame(0x77F, {0}));
  ASSERT_TRUE(boot_up);
  EXPECT_EQ(boot_up->node, 127);
  EXPECT_EQ(boot_up->state, NodeState::BootUp);
}

TEST(Heartbeat, RefusesUnknownStatesAndForeignIdentifiers) {
  EXPECT_FALSE(decode_heartbeat(standard_frame(0x705, {6})));
  EXPECT_FALSE(decode_heartbeat(standard_frame(0x700, {5})));
  EXPECT_FALSE(decode_heartbeat(standard_frame(0x780, {5})));
  EXPECT_FALSE(decode_heartbeat(standard_frame(0x705, {})));
}

TEST(Emergency, IsCodeRegisterAndFiveManufacturerBytes) {
  const auto frame = standard_frame(0x083, {0x30, 0x81, 0x11, 1, 2, 3, 4, 5});
  const auto emergency = decode_emergency(frame);
  ASSERT_TRUE(emergency);
  EXPECT_EQ(emergency->node, 3);
  EXPECT_EQ(emergency->code, 0x8130);  // heartbeat lost
  EXPECT_EQ(emergency->error_register, 0x11);
  EXPECT_EQ(encode_emergency(*emergency), frame);
}

TEST(Emergency, IsNotASyncAndNotShort) {
  EXPECT_FALSE(decode_emergency(encode_sync()));
  EXPECT_FALSE(decode_emergency(standard_frame(0x083, {0, 0, 0, 0, 0, 0, 0})));
}

TEST(ControlEmergency, CarriesTheCauseOrItsReset) {
  for (const auto cause : {ControlCause::NotHomed, ControlCause::NoPosition}) {
    const auto frame = encode_emergency(control_emergency(3, cause));
    const auto emergency = decode_emergency(frame);
    ASSERT_TRUE(emergency);
    EXPECT_EQ(emergency->node, 3);
    EXPECT_EQ(control_cause(*emergency), cause);
  }
  EXPECT_EQ(control_emergency(3, std::nullopt).code, 0);
  EXPECT_FALSE(control_cause(control_emergency(3, std::nullopt)));
}

TEST(ControlEmergency, IsNotTheSameCodeOfAnotherDevice) {
  Emergency emergency = control_emergency(1, ControlCause::NotHomed);
  emergency.manufacturer[0] = std::byte{'M'};
  EXPECT_FALSE(control_cause(emergency));
  emergency = control_emergency(1, ControlCause::NotHomed);
  emergency.manufacturer[4] = std::byte{0};
  EXPECT_FALSE(control_cause(emergency));
  emergency = control_emergency(1, ControlCause::NotHomed);
  emergency.code = 0xFF02;
  EXPECT_FALSE(control_cause(emergency));
}

TEST(Canopen, IgnoresExtendedRemoteAndErrorFrames) {
  for (const auto flag : {FrameFlag::Extended, FrameFlag::Remote, FrameFlag::Error}) {
    auto heartbeat = encode_heartbeat(5, NodeState::Operational);
    auto sync = encode_sync();
    heartbeat.set(flag);
    sync.set(flag);
    EXPECT_FALSE(decode_heartbeat(heartbeat));
    EXPECT_FALSE(decode_sync(sync));
  }
}

TEST(Pdo, MapsThePositionAsIndexSubAndBits) {
  EXPECT_EQ(encode_mapping(mapped_position(PositionType::Signed32)), 0x60040020u);
  EXPECT_EQ(encode_mapping(mapped_position(PositionType::Signed64)), 0x60080040u);
  EXPECT_EQ(decode_mapping(0x60200120u), (MappedObject{0x6020, 1, 32}));
}

TEST(Pdo, ReadsOneBitPatternAsTheTypeSays) {
  const auto frame = standard_frame(0x181, {0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF});
  EXPECT_EQ(decode_position(frame.payload(), PositionType::Signed32), -2);
  EXPECT_EQ(decode_position(frame.payload(), PositionType::Unsigned32), 4294967294);
  EXPECT_EQ(decode_position(frame.payload(), PositionType::Signed64), -2);
}

TEST(Pdo, WritesThePositionLowByteFirst) {
  EXPECT_EQ(encode_position(0x185, PositionType::Signed32, 0x01020304),
            standard_frame(0x185, {4, 3, 2, 1}));
  EXPECT_EQ(encode_position(0x185, PositionType::Signed32, -1),
            standard_frame(0x185, {255, 255, 255, 255}));
}

TEST(Pdo, RefusesPayloadsTooShortForTheType) {
  const auto frame = standard_frame(0x181, {1, 2, 3, 4});
  EXPECT_FALSE(decode_position(frame.payload(), PositionType::Signed64));
  EXPECT_FALSE(decode_position(frame.payload(), PositionType::Signed32, 1));
  EXPECT_FALSE(decode_position(frame.payload(), PositionType::Signed32, 99));
  EXPECT_FALSE(decode_position({}, PositionType::Unsigned32));
}

TEST(ErrorFrame, NamesBusOffNoAckAndControllerDetail) {
  CanFrame frame;
  frame.set(FrameFlag::Error);
  frame.id = 0x004 | 0x020 | 0x040;
  frame.length = 8;
  frame.data[1] = std::byte{0x01 | 0x20};
  const auto report = decode_error_frame(frame);
  ASSERT_TRUE(report);

  for (const auto condition : {BusCondition::BusOff, BusCondition::NoAcknowledge,
                               BusCondition::ReceiveOverflow, BusCondition::Passive}) {
    EXPECT_TRUE(has(report->conditions, condition));
  }

  EXPECT_FALSE(has(report->conditions, BusCondition::Restarted));
  EXPECT_FALSE(report->has_counters);
}

TEST(ErrorFrame, CarriesTheErrorCounters) {
  const BusReport sent{static_cast<BusConditions>(BusCondition::Restarted), true, 96, 128};
  const auto seen = decode_error_frame(encode_error_frame(sent));
  ASSERT_TRUE(seen);
  EXPECT_EQ(seen->conditions, sent.conditions);
  EXPECT_TRUE(seen->has_counters);
  EXPECT_EQ(seen->transmit_errors, 96);
  EXPECT_EQ(seen->receive_errors, 128);
}

TEST(ErrorFrame, IsNotADataFrame) {
  EXPECT_FALSE(decode_error_frame(standard_frame(0x040, {})));
}

TEST(EmergencyText, NamesTheNarrowestClassOfACode) {
  EXPECT_STREQ(emergency_text(0x8130), "communication: life guard or heartbeat error");
  EXPECT_STREQ(emergency_text(0x81F0), "communication");
  EXPECT_STREQ(emergency_text(0x80AB), "monitoring");
  EXPECT_STREQ(emergency_text(0x4200), "device temperature");
  EXPECT_STREQ(emergency_text(0x5003), "device hardware");
  EXPECT_STREQ(emergency_text(0xFF01), "device specific");
  EXPECT_STREQ(emergency_text(0xA000), "code reserved by CiA 301");
}

}  // namespace
}  // namespace abbe::protocol::can

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "abbe/protocol/can/encoder_configurator.hpp"
#include "abbe/protocol/can/error_frame.hpp"
#include "abbe/protocol/can/udp_framing.hpp"
#include "abbe/sim/encoder_bus.hpp"
#include "loopback_client.hpp"
#include "tracker_script.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;

constexpr HostTime kPowerOn{100s};

std::vector<can::CanFrame> frames_of(EncoderNode& node) {
  std::vector<can::CanFrame> frames;
  for (const TimedFrame& timed : node.take_frames()) frames.push_back(timed.frame);
  return frames;
}

/// Brings the node to "operational, position at every SYNC" with the configurator the driver uses.
HostTime configure(EncoderNode& node, HostTime now) {
  can::EncoderPlan plan;
  plan.node = node.node();
  can::EncoderConfigurator master(plan);
  node.advance(now);
  frames_of(node);
  master.start(now);

  for (int turn = 0; turn < 1000 && master.state() == can::EncoderConfigurator::State::Working;
       ++turn) {
    now += 1ms;
    while (const auto frame = master.take_frame()) node.on_frame(*frame, now);
    for (const can::CanFrame& frame : frames_of(node)) master.on_frame(frame, now);
  }

  while (const auto frame = master.take_frame()) node.on_frame(*frame, now);
  frames_of(node);
  EXPECT_EQ(master.state(), can::EncoderConfigurator::State::Ready)
      << can::to_text(master.error().fault);

  return now;
}

TEST(EncoderNode, BootsThenIsConfiguredThenAnswersSync) {
  const VirtualMachine machine = test::standing_machine();
  EncoderNode node({.node = 5, .axis = Axis::Y, .noise = 0.0}, machine, kPowerOn);
  node.advance(kPowerOn);
  const auto boot = can::decode_heartbeat(frames_of(node).at(0));

  ASSERT_TRUE(boot);
  EXPECT_EQ(boot->state, can::NodeState::BootUp);
  const HostTime now = configure(node, kPowerOn + 1s);
  node.on_frame(can::encode_sync(), now + 1ms);
  const auto frames = frames_of(node);
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].id, can::cob::tpdo(1, 5));
  EXPECT_EQ(can::decode_position(frames[0].payload(), can::PositionType::Signed32),
            20'000'000);  // 0.2 m of 10 nm
}

TEST(EncoderNode, ReadsTheScaleAtTheSyncAndNotTheTruePosition) {
  PathPlan plan;
  plan.vertices = {{{0, 0, 0}}, {{0.5, 0, 0}}};
  plan.feed_m_per_s = 0.1;
  TruthMachine truth;

  // EXX of 1 mm everywhere
  truth.axis(Axis::X).error[0] = ErrorFunction({-1.0, 1.0}, {1e-3, 1e-3});
  VirtualMachine machine(truth, PathMotion::plan(plan).value());
  EncoderNode node({.node = 1, .axis = Axis::X, .noise = 0.0}, machine, kPowerOn);
  const HostTime now = configure(node, kPowerOn + 1s);
  machine.start(now);
  const HostTime sync = now + 2s;
  node.on_frame(can::encode_sync(), sync);
  const auto count =
      can::decode_position(frames_of(node).back().payload(), can::PositionType::Signed32);
  EXPECT_EQ(count, std::llround(machine.motion(sync).q_m.x() / 10e-9));
}

TEST(EncoderNode, CountsTheRevolutionOfARotaryAxis) {
  VirtualMachine machine = test::standing_machine();
  constexpr std::uint32_t kUnits = 3'600'000;
  EncoderNode node({.node = 4,
                    .axis = RotarySwing{.amplitude_rad = 0.1, .period_s = 8.0},
                    .units_per_revolution = kUnits,
                    .noise = 0.0},
                   machine, kPowerOn);
  EXPECT_FALSE(can::object::is_linear(
      static_cast<std::uint32_t>(*node.objects().number(can::object::kDeviceType))));
  EXPECT_EQ(node.objects().number(can::object::kUnitsPerRevolution), kUnits);
  EXPECT_EQ(node.objects().number(can::object::kTotalRange), kUnits);
  const HostTime now = configure(node, kPowerOn + 1s);
  const auto count_at = [&](HostTime at) {
    node.on_frame(can::encode_sync(), at);
    return can::decode_position(frames_of(node).back().payload(), can::PositionType::Unsigned32);
  };
  EXPECT_EQ(count_at(now), 0);  // the machine stands
  machine.start(now);
  const std::int64_t swing = std::llround(0.1 / (2.0 * std::numbers::pi) * kUnits);
  EXPECT_EQ(count_at(now + 2s), swing);
  EXPECT_EQ(count_at(now + 6s), kUnits - swing);
}

TEST(EncoderNode, HasItsOwnNoiseWhichIsTheSameInEveryRun) {
  const VirtualMachine machine = test::standing_machine();
  const auto counts = [&](std::uint64_t seed) {
    EncoderNode node({.node = 1, .axis = Axis::X, .step_nm = 1, .noise = 50e-9, .seed = seed},
                     machine, kPowerOn);
    HostTime now = configure(node, kPowerOn + 1s);
    std::vector<double> values;
    for (int i = 0; i < 2000; ++i) {
      node.on_frame(can::encode_sync(), now += 1ms);
      for (const can::CanFrame& frame : frames_of(node)) {
        if (frame.id != can::cob::tpdo(1, 1)) continue;
        values.push_back(static_cast<double>(
            *can::decode_position(frame.payload(), can::PositionType::Signed32)));
      }
    }
    return values;
  };

  const std::vector<double> values = counts(1);
  ASSERT_EQ(values.size(), 2000u);
  double square = 0.0;
  for (const double v : values) square += (v - 1e8) * (v - 1e8);  // 0.1 m of 1 nm

  EXPECT_NEAR(std::sqrt(square / 2000.0), 50.0, 3.0);
  EXPECT_EQ(values, counts(1));
  EXPECT_NE(values, counts(2));
}

TEST(EncoderNode, SendsHeartbeats) {
  const VirtualMachine machine = test::standing_machine();
  EncoderNode node({.node = 3}, machine, kPowerOn);
  HostTime now = configure(node, kPowerOn + 1s);
  int beats = 0;
  for (int i = 0; i < 1000; ++i) {
    node.advance(now += 1ms);
    for (const can::CanFrame& frame : frames_of(node))
      beats += can::decode_heartbeat(frame).has_value() ? 1 : 0;
  }
  EXPECT_NEAR(beats, 10, 1);
}

TEST(EncoderNode, MuteNodeSendsNothingUntilTheFaultEnds) {
  const VirtualMachine machine = test::standing_machine();
  EncoderNode node({.node = 3}, machine, kPowerOn);
  const HostTime now = configure(node, kPowerOn + 1s);
  node.mute_until(now + 1s);
  node.on_frame(can::encode_sync(), now + 500ms);
  EXPECT_TRUE(frames_of(node).empty());
  node.on_frame(can::encode_sync(), now + 1500ms);
  EXPECT_FALSE(frames_of(node).empty());
}

TEST(EncoderNode, RestartedNodeBootsWithoutItsConfiguration) {
  const VirtualMachine machine = test::standing_machine();
  EncoderNode node({.node = 3}, machine, kPowerOn);
  const HostTime now = configure(node, kPowerOn + 1s);
  node.restart(now);
  node.on_frame(can::encode_sync(), now + 100ms);

  EXPECT_TRUE(frames_of(node).empty());
  node.advance(now + 300ms);
  EXPECT_EQ(can::decode_heartbeat(frames_of(node).at(0))->state, can::NodeState::BootUp);
  node.on_frame(can::encode_sync(), now + 400ms);
  EXPECT_TRUE(frames_of(node).empty());
  configure(node, now + 500ms);
  node.on_frame(can::encode_sync(), now + 3s);
  EXPECT_FALSE(frames_of(node).empty());
}

/// A bus of three nodes on a real UDP port, and its peer.
class EncoderBusTest : public testing::Test {
 protected:
  EncoderBusTest() {
    for (EncoderNode& node : bus_.nodes()) now_ = std::max(now_, configure(node, kPowerOn + 1s));
  }

  static EncoderBus open(const VirtualMachine& machine) {
    const std::array<EncoderNodeOptions, 3> nodes{EncoderNodeOptions{.node = 1, .axis = Axis::X},
                                                  EncoderNodeOptions{.node = 2, .axis = Axis::Y},
                                                  EncoderNodeOptions{.node = 3, .axis = Axis::Z}};
    return EncoderBus::open({}, nodes, machine, kPowerOn).value();
  }

  void send(const can::CanFrame& frame) {
    std::array<std::byte, 200> buffer{};
    can::DatagramWriter writer(buffer, sequence_++);
    EXPECT_TRUE(writer.add(frame));
    test::send_bytes(peer_, writer.finish());
    test::readable(bus_.fd());
    bus_.poll(now_ += 1ms);
  }

  std::vector<can::CanFrame> receive() {
    std::vector<can::CanFrame> frames;
    const std::vector<std::byte> bytes = test::receive_bytes(peer_);
    auto view = can::DatagramView::parse(bytes);
    if (!view) return frames;
    for (can::CanFrame frame; view->next(frame);) frames.push_back(frame);
    return frames;
  }

  HostTime now_ = kPowerOn;
  VirtualMachine machine_ = test::standing_machine();
  EncoderBus bus_ = open(machine_);
  Socket peer_ = test::connected(SOCK_DGRAM, bus_.port());
  std::uint8_t sequence_ = 0;
};

TEST_F(EncoderBusTest, AllNodesAnswerOneSyncInOneDatagram) {
  send(can::encode_sync());
  const auto frames = receive();
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[0].id, can::cob::tpdo(1, 1));
  EXPECT_EQ(frames[2].id, can::cob::tpdo(1, 3));
}

TEST_F(EncoderBusTest, HoldsFramesBackAsATunnelDoes) {
  send(can::encode_sync());
  receive();
  bus_.inject({FaultKind::Bundled, 0.0, 10.0, 20e-3, 0}, now_);
  for (int i = 0; i < 3; ++i) send(can::encode_sync());
  EXPECT_FALSE(test::readable(peer_.get(), 0));
  bus_.poll(now_ += 20ms);
  EXPECT_EQ(receive().size(), 9u);
}

TEST_F(EncoderBusTest, OverflowIsAnErrorFrame) {
  send(can::encode_sync());
  receive();
  bus_.inject({FaultKind::Overflow, 0.0, 0.0, 0.0, 0}, now_);
  EXPECT_TRUE(can::has(can::decode_error_frame(receive().at(0))->conditions,
                       can::BusCondition::ReceiveOverflow));
}

TEST_F(EncoderBusTest, ProducesTheSyncOnRequest) {
  send(can::encode_sync());  // the bus learns the address of its peer
  receive();
  bus_.produce_sync(4ms, now_ + 4ms);
  EXPECT_EQ(bus_.next_due(), now_ + 4ms);
  for (int i = 0; i < 2; ++i) {
    bus_.poll(now_ += 4ms);
    const auto frames = receive();
    ASSERT_EQ(frames.size(), 4u);
    EXPECT_TRUE(can::decode_sync(frames[0]));
    EXPECT_EQ(frames[1].id, can::cob::tpdo(1, 1));
  }
}

TEST(ConfiguredEncoderNode, AnswersASyncWithoutBeingConfigured) {
  const VirtualMachine machine = test::standing_machine();
  EncoderNode node({.node = 5, .noise = 0.0, .configured = true}, machine, kPowerOn);
  node.advance(kPowerOn);
  frames_of(node);
  node.on_frame(can::encode_sync(), kPowerOn + 1ms);
  const auto frames = frames_of(node);
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].id, can::cob::tpdo(1, 5));
}

TEST_F(EncoderBusTest, LateNodeIsLateAndTheOthersAreNot) {
  send(can::encode_sync());
  receive();
  bus_.inject({FaultKind::Late, 0.0, 10.0, 5e-3, 2}, now_);
  send(can::encode_sync());
  EXPECT_EQ(receive().size(), 2u);
  bus_.poll(now_ + 5ms);
  const auto late = receive();
  ASSERT_EQ(late.size(), 1u);
  EXPECT_EQ(late[0].id, can::cob::tpdo(1, 2));
}

TEST_F(EncoderBusTest, BusOffIsAnErrorFrameThenSilenceThenRestarted) {
  send(can::encode_sync());
  receive();
  bus_.inject({FaultKind::BusOff, 0.0, 1.0, 0.0, 0}, now_);
  EXPECT_TRUE(
      can::has(can::decode_error_frame(receive().at(0))->conditions, can::BusCondition::BusOff));
  send(can::encode_sync());
  EXPECT_FALSE(test::readable(peer_.get(), 0));
  bus_.poll(now_ += 1s);
  EXPECT_TRUE(
      can::has(can::decode_error_frame(receive().at(0))->conditions, can::BusCondition::Restarted));
}

TEST_F(EncoderBusTest, EmergencyIsFollowedByEmergencyNoError) {
  send(can::encode_sync());
  receive();
  bus_.inject({FaultKind::Emergency, 0.0, 0.02, 0x5000, 2}, now_);
  EXPECT_EQ(can::decode_emergency(receive().at(0))->code, 0x5000);
  bus_.poll(now_ += 20ms);
  EXPECT_EQ(can::decode_emergency(receive().at(0))->code, 0);
}

TEST_F(EncoderBusTest, SendsGarbageOnRequest) {
  send(can::encode_sync());
  receive();
  bus_.inject({FaultKind::BusGarbage, 0.0, 0.0, 0.0, 0}, now_);
  const auto bytes = test::receive_bytes(peer_);
  EXPECT_FALSE(bytes.empty());
  EXPECT_FALSE(can::DatagramView::parse(bytes));
}

TEST_F(EncoderBusTest, IgnoresDatagramsThatAreNotFrames) {
  constexpr std::array<std::byte, 3> kMalformed{std::byte{9}, std::byte{9}, std::byte{9}};
  test::send_bytes(peer_, kMalformed);
  test::readable(bus_.fd());
  bus_.poll(now_);
  send(can::encode_sync());
  EXPECT_EQ(receive().size(), 3u);
}

TEST_F(EncoderBusTest, MissingInterfaceIsAClearError) {
  EncoderBusOptions options;
  options.interface = "nocan99";
  const auto refused = EncoderBus::open(options, {}, machine_, now_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::Io);
  EXPECT_THAT(refused.error().text, testing::HasSubstr("nocan99"));
}

TEST_F(EncoderBusTest, PortInUseIsAClearError) {
  const auto second = EncoderBus::open({.port = bus_.port()}, {}, machine_, now_);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Io);
  EXPECT_THAT(second.error().text, testing::HasSubstr(std::to_string(bus_.port())));
}

}  // namespace
}  // namespace abbe::sim

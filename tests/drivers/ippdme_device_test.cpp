#include "abbe/drivers/ippdme/device.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>

#include "ippdme_stage.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::IppDevice;
using drivers::IppDeviceOptions;
using drivers::ProbePoint;
using protocol::ProbeTrigger;
using protocol::TouchFlag;

TEST(IppDevice, MeasuresRequestedPoints) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  stage.device->measure(on_top());
  ASSERT_TRUE(stage.cycles_until(30s, [&] { return !stage.touches.empty(); }))
      << stage.last_fault();
  const ProbeTrigger& t = stage.touches[0];
  EXPECT_EQ(t.latch, protocol::TouchLatch::Reported);
  EXPECT_EQ(t.touch_flags, 0u);
  // The centre of a tip of 2 mm on top of the sphere; 1 nm: nine decimals of a millimetre on the
  // wire.
  EXPECT_NEAR(t.position[2], -0.1 + 12.5e-3 + 2e-3, 1e-9);
  EXPECT_GT(t.head.u_time, 10ms);
}

TEST(IppDevice, ReadsAtTheTouchWhatAMachineWithErrorsReads) {
  sim::IppDmeOptions options = machine_with_a_sphere();
  options.machine.truth.squareness.B0Z_rad = 100e-6;
  IppStage stage{options};
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  const Eigen::Vector3d centre{0.1, 0.2, -0.1};
  const std::vector<Eigen::Vector3d> normals = {Eigen::Vector3d{0.0, 0.0, 1.0},
                                                Eigen::Vector3d{1.0, 0.0, 0.0},
                                                Eigen::Vector3d{0.0, -0.6, 0.8}};

  for (const auto& n : normals) {
    const Eigen::Vector3d p = centre + (12.5e-3 + 2e-3) * n;
    stage.device->measure({{p[0], p[1], p[2]}, {n[0], n[1], n[2]}});
  }

  ASSERT_TRUE(stage.cycles_until(60s, [&] { return stage.touches.size() == normals.size(); }))
      << stage.last_fault();
  for (std::size_t i = 0; i < normals.size(); ++i) {
    EXPECT_EQ(stage.touches[i].touch, i + 1);
    const auto& p = stage.touches[i].position;
    const Eigen::Vector3d tip = sim::position_m(options.machine.truth, {p[0], p[1], p[2]});
    EXPECT_NEAR((tip - centre).norm(), 12.5e-3 + 2e-3, 1e-9);
    EXPECT_GT((Eigen::Vector3d{p[0], p[1], p[2]} - tip).norm(), 5e-6);  // 100 urad at z = -0.1 m
  }
}

TEST(IppDevice, MovesAlongTheApproachPathWithoutTouching) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  stage.device->measure({.position_m = {0.1, 0.2, 0.0}, .touch = false});
  stage.device->measure(on_top());
  EXPECT_EQ(stage.device->points_left(), 2u);
  ASSERT_TRUE(stage.cycles_until(30s, [&] { return stage.device->points_left() == 0; }));
  ASSERT_EQ(stage.touches.size(), 1u);
  EXPECT_EQ(stage.touches[0].touch, 1u);
  EXPECT_EQ(stage.touches[0].touch_flags, 0u);
  EXPECT_EQ(stage.device->status().faults, 0u);
}

TEST(IppDevice, DropsTheRequestsBehindARefusedMove) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  stage.peer.machine().inject({.kind = sim::FaultKind::RefuseWay}, stage.time.now());
  stage.device->measure({.position_m = {0.1, 0.2, 0.1}, .touch = false});
  stage.device->measure(on_top());
  ASSERT_TRUE(stage.cycles_until(30s, [&] { return stage.device->points_left() == 0; }));
  EXPECT_TRUE(stage.touches.empty());
  EXPECT_NE(stage.last_fault().find("GoTo was refused: 2500"), std::string::npos)
      << stage.last_fault();
}

TEST(IppDevice, DropsTheTouchIfTheConnectionIsLostDuringTheMove) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  stage.peer.reset_connection();
  const std::array way{ProbePoint{.position_m = {0.1, 0.2, 0.1}, .touch = false}, on_top()};
  stage.device->measure(way);
  stage.device->wait(0ns);
  EXPECT_EQ(stage.device->points_left(), 0u);
  ASSERT_TRUE(stage.state_becomes("ready"));
  for (int i = 0; i < 100; ++i) stage.cycle();
  EXPECT_TRUE(stage.touches.empty());
}

TEST(IppDevice, DropsRequestsWhileTheMachineIsNotConnected) {
  IppStage stage;
  stage.device->measure(on_top());
  stage.cycle();

  EXPECT_EQ(stage.device->points_left(), 0u);
  EXPECT_NE(stage.last_fault().find("asked to move while"), std::string::npos)
      << stage.last_fault();
  ASSERT_TRUE(stage.state_becomes("ready"));
  stage.peer.unplug();
  ASSERT_TRUE(stage.cycles_until(30s, [&] { return !stage.device->status().connected; }));
  stage.device->measure(on_top());
  stage.cycle();
  stage.peer.listen();
  ASSERT_TRUE(stage.state_becomes("ready"));
  for (int i = 0; i < 100; ++i) stage.cycle();
  EXPECT_TRUE(stage.touches.empty());
  EXPECT_EQ(stage.device->status().state, "ready");
}

TEST(IppDevice, TakesTouchesMadeByHand) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  stage.peer.machine().touch_by_hand({0.01, 0.02, 0.03});
  ASSERT_TRUE(stage.cycles_until(1s, [&] { return !stage.touches.empty(); }));
  EXPECT_NEAR(stage.touches[0].position[1], 0.02, 1e-12);
}

TEST(IppDevice, FollowsThePositionAtMostTenTimesASecond) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  std::array<protocol::AxisSample, 64> out{};
  (void)stage.device->positions().pop(out);
  (void)stage.cycles_until(2s, [] { return false; });
  const std::size_t n = stage.device->positions().pop(out);
  EXPECT_GE(n, 10u);
  EXPECT_LE(n, 21u);
}

TEST(IppDevice, AnAnswerThatWaitsForTheThreadIsNoTimeOut) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  const auto answered = [&stage, asked = stage.times_heard("Get(X(),Y(),Z())")] {
    stage.peer.serve(stage.time.now());
    return stage.times_heard("Get(X(),Y(),Z())") > asked;
  };

  while (!answered()) stage.cycle();
  stage.time.advance(100ms);
  stage.peer.serve(stage.time.now());
  stage.peer.send_gathered();
  stage.time.advance(4s);  // more than command_timeout: the process was stopped
  stage.cycles_for(1s);
  EXPECT_EQ(stage.device->status().faults, 0u) << stage.last_fault();
  EXPECT_EQ(stage.state(), "ready");
  EXPECT_EQ(stage.times_heard("StartSession()"), 1);
}

TEST(IppDevice, RefusesAToolThatTheMachineDoesNotHave) {
  IppDeviceOptions options;
  options.session.tool = "ruby 9";
  IppStage stage{machine_with_a_sphere(), options};
  ASSERT_TRUE(stage.state_becomes("awaiting release"));
  EXPECT_NE(stage.last_fault().find("SetTool was refused: 1502 Tool not found"), std::string::npos)
      << stage.last_fault();
}

TEST(IppDevice, RefusesAMachineThatIsNotHomed) {
  IppStage stage{not_homed()};
  ASSERT_TRUE(stage.state_becomes("faulted"));
  EXPECT_NE(stage.last_fault().find("not homed"), std::string::npos);
}

TEST(IppDevice, HomesTheMachineIfPermitted) {
  IppStage stage{not_homed(), that_may_home()};
  EXPECT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
}

TEST(IppDevice, ReportsAPeerThatIsNoMeasuringMachine) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  stage.peer.send("HTTP/1.1 400 Bad Request\r\n");
  ASSERT_TRUE(stage.state_becomes("faulted"));
  EXPECT_NE(stage.last_fault().find("no I++ DME server"), std::string::npos);
  EXPECT_NE(stage.last_fault().find("HTTP/1.1"), std::string::npos);
}

TEST(IppDevice, ReportsAnUnrequestedAnswer) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  stage.peer.send("09999 %\r\n");
  ASSERT_TRUE(stage.cycles_until(1s, [&] { return stage.device->status().faults > 0; }));
  EXPECT_NE(stage.last_fault().find("09999"), std::string::npos);
}

TEST(IppDevice, ChecksItsOptions) {
  const SteppedTime time;
  IppDeviceOptions options;
  options.session.poll_period = 20ms;
  const auto refused = IppDevice::create(options, time);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, drivers::ErrorCode::BadConfiguration);
  EXPECT_NE(refused.error().text.find("10 reports a second"), std::string::npos);
}

}  // namespace
}  // namespace abbe::tests

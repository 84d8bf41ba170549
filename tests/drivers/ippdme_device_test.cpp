#include "abbe/drivers/ippdme/device.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>

#include "ippdme_peer.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::IppDevice;
using drivers::IppDeviceOptions;
using drivers::ProbePoint;
using drivers::SteppedTime;
using protocol::ProbeTrigger;
using protocol::TouchFlag;

sim::IppDmeOptions machine_with_a_sphere() {
  sim::IppDmeOptions o;
  o.machine.spheres = {{.centre_m = {0.1, 0.2, -0.1}, .radius_m = 12.5e-3}};
  return o;
}

/// A driver, its server and their common time.
struct Stage {
  explicit Stage(const sim::IppDmeOptions& machine = machine_with_a_sphere(), IppDeviceOptions options = {})
      : peer(time.now(), machine) {
    options.port = peer.port();
    device = IppDevice::create(options, time).value();
  }
  void turn() {
    peer.serve(time.now());
    peer.say_gathered();
    device->wait(20ms);
    device->receive();
    time.advance(20ms);
    std::array<ProbeTrigger, 16> out{};
    const std::size_t n = device->touches().pop(out);
    touches.insert(touches.end(), out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n));
  }
  template <class Done>
  bool turns_until(std::chrono::nanoseconds limit, Done done) {
    for (const auto end = time.now() + limit; !done(); turn())
      if (time.now() >= end) return false;
    return true;
  }
  bool state_becomes(std::string_view state) {
    return turns_until(30s, [&] { return device->status().state == state; });
  }

  SteppedTime time;
  IppDmePeer peer;
  std::unique_ptr<IppDevice> device;
  std::vector<ProbeTrigger> touches;
};

ProbePoint on_top() {
  return {.position_m = {0.1, 0.2, -0.1 + 12.5e-3 + 2e-3}, .normal = {0, 0, 1}};
}

TEST(IppDevice, MeasuresWhatIsAsked) {
  Stage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.device->status().last_fault;
  stage.device->measure(on_top());
  ASSERT_TRUE(stage.turns_until(30s, [&] { return !stage.touches.empty(); }))
      << stage.device->status().last_fault;
  const ProbeTrigger& t = stage.touches[0];
  EXPECT_EQ(t.latch, protocol::TouchLatch::Reported);
  EXPECT_EQ(t.touch_flags, 0u);
  // The centre of a tip of 2 mm on top of the sphere; 1 nm: nine decimals of a millimetre on the wire.
  EXPECT_NEAR(t.position[2], -0.1 + 12.5e-3 + 2e-3, 1e-9);
  EXPECT_GT(t.head.u_time, 10ms);
}

TEST(IppDevice, ReadsAtTheTouchWhatAMachineWithErrorsReads) {
  sim::IppDmeOptions options = machine_with_a_sphere();
  options.machine.truth.squareness.B0Z_rad = 100e-6;
  Stage stage{options};
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.device->status().last_fault;
  const Eigen::Vector3d centre{0.1, 0.2, -0.1};
  const std::vector<Eigen::Vector3d> normals = {
      Eigen::Vector3d{0.0, 0.0, 1.0}, Eigen::Vector3d{1.0, 0.0, 0.0}, Eigen::Vector3d{0.0, -0.6, 0.8}};
  for (const auto& n : normals) {
    const Eigen::Vector3d p = centre + (12.5e-3 + 2e-3) * n;
    stage.device->measure({{p[0], p[1], p[2]}, {n[0], n[1], n[2]}});
  }
  ASSERT_TRUE(stage.turns_until(60s, [&] { return stage.touches.size() == normals.size(); }))
      << stage.device->status().last_fault;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    EXPECT_EQ(stage.touches[i].touch, i + 1);
    const auto& p = stage.touches[i].position;
    const Eigen::Vector3d tip = sim::position_m(options.machine.truth, {p[0], p[1], p[2]});
    EXPECT_NEAR((tip - centre).norm(), 12.5e-3 + 2e-3, 1e-9);
    EXPECT_GT((Eigen::Vector3d{p[0], p[1], p[2]} - tip).norm(), 5e-6);  // 100 urad at z = -0.1 m
  }
}

TEST(IppDevice, GoesTheWayToATouchWithoutTouching) {
  Stage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.device->status().last_fault;
  stage.device->measure({.position_m = {0.1, 0.2, 0.0}, .touch = false});
  stage.device->measure(on_top());
  EXPECT_EQ(stage.device->points_left(), 2u);
  ASSERT_TRUE(stage.turns_until(30s, [&] { return stage.device->points_left() == 0; }));
  ASSERT_EQ(stage.touches.size(), 1u);
  EXPECT_EQ(stage.touches[0].touch, 1u);
  EXPECT_EQ(stage.touches[0].touch_flags, 0u);
  EXPECT_EQ(stage.device->status().faults, 0u);
}

TEST(IppDevice, ForgetsWhatIsBehindAWayThatWasRefused) {
  Stage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.device->status().last_fault;
  stage.peer.machine().inject({.kind = sim::FaultKind::RefuseWay}, stage.time.now());
  stage.device->measure({.position_m = {0.1, 0.2, 0.1}, .touch = false});
  stage.device->measure(on_top());
  ASSERT_TRUE(stage.turns_until(30s, [&] { return stage.device->points_left() == 0; }));
  EXPECT_TRUE(stage.touches.empty());
  EXPECT_NE(stage.device->status().last_fault.find("GoTo was refused: 2500"), std::string::npos)
      << stage.device->status().last_fault;
}

TEST(IppDevice, ForgetsTheTouchWhenTheConnectionIsLostOnTheWay) {
  Stage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.device->status().last_fault;
  stage.peer.reset_connection();
  const std::array way{ProbePoint{.position_m = {0.1, 0.2, 0.1}, .touch = false}, on_top()};
  stage.device->measure(way);
  stage.device->wait(0ns);
  EXPECT_EQ(stage.device->points_left(), 0u);
  ASSERT_TRUE(stage.state_becomes("ready"));
  for (int i = 0; i < 100; ++i) stage.turn();
  EXPECT_TRUE(stage.touches.empty());
}

TEST(IppDevice, ForgetsWhatIsAskedOfAMachineThatIsAway) {
  Stage stage;
  stage.device->measure(on_top());
  stage.turn();
  EXPECT_EQ(stage.device->points_left(), 0u);
  EXPECT_NE(stage.device->status().last_fault.find("asked to move while"), std::string::npos)
      << stage.device->status().last_fault;
  ASSERT_TRUE(stage.state_becomes("ready"));
  stage.peer.unplug();
  ASSERT_TRUE(stage.turns_until(30s, [&] { return !stage.device->status().connected; }));
  stage.device->measure(on_top());
  stage.turn();
  stage.peer.listen();
  ASSERT_TRUE(stage.state_becomes("ready"));
  for (int i = 0; i < 100; ++i) stage.turn();
  EXPECT_TRUE(stage.touches.empty());
  EXPECT_EQ(stage.device->status().state, "ready");
}

TEST(IppDevice, SaysThatATouchFailedAndGoesOn) {
  Stage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.device->status().last_fault;
  stage.device->measure({.position_m = {0.3, 0.3, 0.0}});
  stage.device->measure(on_top());
  ASSERT_TRUE(stage.turns_until(60s, [&] { return stage.touches.size() == 2; }))
      << stage.device->status().last_fault;
  EXPECT_TRUE(has(stage.touches[0].touch_flags, TouchFlag::NoPosition));
  EXPECT_TRUE(std::isnan(stage.touches[0].position[0]));
  EXPECT_EQ(stage.touches[1].touch_flags, 0u);
  EXPECT_NE(stage.device->status().last_fault.find("1006 Surface not found"), std::string::npos)
      << stage.device->status().last_fault;
}

TEST(IppDevice, TakesTouchesMadeByHand) {
  Stage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  stage.peer.machine().touch_by_hand({0.01, 0.02, 0.03});
  ASSERT_TRUE(stage.turns_until(1s, [&] { return !stage.touches.empty(); }));
  EXPECT_NEAR(stage.touches[0].position[1], 0.02, 1e-12);
}

TEST(IppDevice, FollowsThePositionAtMostTenTimesASecond) {
  Stage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  std::array<protocol::AxisSample, 64> out{};
  (void)stage.device->positions().pop(out);
  (void)stage.turns_until(2s, [] { return false; });
  const std::size_t n = stage.device->positions().pop(out);
  EXPECT_GE(n, 10u);
  EXPECT_LE(n, 21u);
}

TEST(IppDevice, RefusesAToolThatTheMachineDoesNotHave) {
  IppDeviceOptions options;
  options.session.tool = "ruby 9";
  Stage stage{machine_with_a_sphere(), options};
  ASSERT_TRUE(stage.state_becomes("faulted"));
  EXPECT_NE(stage.device->status().last_fault.find("SetTool was refused: 1502 Tool not found"),
            std::string::npos)
      << stage.device->status().last_fault;
}

TEST(IppDevice, RefusesAMachineThatIsNotHomed) {
  sim::IppDmeOptions machine = machine_with_a_sphere();
  machine.homed = false;
  Stage stage{machine};
  ASSERT_TRUE(stage.state_becomes("faulted"));
  EXPECT_NE(stage.device->status().last_fault.find("not homed"), std::string::npos);
}

TEST(IppDevice, HomesTheMachineIfItMay) {
  sim::IppDmeOptions machine = machine_with_a_sphere();
  machine.homed = false;
  IppDeviceOptions options;
  options.session.home = true;
  Stage stage{machine, options};
  EXPECT_TRUE(stage.state_becomes("ready")) << stage.device->status().last_fault;
}

TEST(IppDevice, NamesAPeerThatIsNoMeasuringMachine) {
  Stage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  stage.peer.send("HTTP/1.1 400 Bad Request\r\n");
  ASSERT_TRUE(stage.state_becomes("faulted"));
  EXPECT_NE(stage.device->status().last_fault.find("no I++ DME server"), std::string::npos);
  EXPECT_NE(stage.device->status().last_fault.find("HTTP/1.1"), std::string::npos);
}

TEST(IppDevice, NamesAnAnswerThatNobodyAskedFor) {
  Stage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  stage.peer.send("09999 %\r\n");
  ASSERT_TRUE(stage.turns_until(1s, [&] { return stage.device->status().faults > 0; }));
  EXPECT_NE(stage.device->status().last_fault.find("09999"), std::string::npos);
}

TEST(IppDevice, StopsAtAnEmergencyStop) {
  Stage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  stage.peer.machine().press_emergency_stop();
  ASSERT_TRUE(stage.turns_until(1s, [&] { return stage.device->status().faults > 0; }));
  EXPECT_NE(stage.device->status().last_fault.find("0500 Emergency stop"), std::string::npos);
}

TEST(IppDevice, EndsTheSessionAndTheMotionWithItself) {
  Stage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  stage.device->measure(on_top());
  ASSERT_TRUE(stage.state_becomes("measuring"));
  stage.turn();
  ASSERT_TRUE(stage.peer.machine().in_session());
  stage.device.reset();
  stage.peer.serve(stage.time.now());
  EXPECT_FALSE(stage.peer.machine().in_session());
}

TEST(IppDevice, ChecksItsOptions) {
  const SteppedTime time;
  IppDeviceOptions options;
  options.session.poll_period = 20ms;
  const auto refused = IppDevice::create(options, time);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, drivers::ErrorCode::BadConfiguration);
  EXPECT_NE(refused.error().text.find("10 times a second"), std::string::npos);
}

}  // namespace
}  // namespace abbe::tests

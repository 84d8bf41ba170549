/// What stops a measuring machine, and what happens after it: AbortE before any connection with a
/// motion is closed, and nothing that moves or clears before a person has released the machine.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <stdexcept>
#include <thread>
#include <utility>

#include "ippdme_stage.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::IppDevice;
using drivers::IppDeviceOptions;
using drivers::ProbePoint;
using protocol::TouchFlag;
using testing::HasSubstr;

/// A stage whose device throws once, when the machine begins to be held: after AbortE counts as
/// sent, before it is sent.
struct ThrowingStage : MovingStage {
  ThrowingStage() : MovingStage(options()) {
    inject(sim::FaultKind::EmergencyStop);
    EXPECT_THROW(cycles_for(10s), std::runtime_error);
  }
  static IppDeviceOptions options() {
    IppDeviceOptions options;
    options.machine_changed = [thrown = false](const drivers::IppMachine& machine) mutable {
      if (!machine.held.empty() && !std::exchange(thrown, true))
        throw std::runtime_error("no memory");
    };
    return options;
  }
};

TEST(IppStop, AnExceptionWhileMovingIsFollowedByAnAbortAtOnce) {
  ThrowingStage stage;
  const auto before = stage.times_heard("AbortE()");
  EXPECT_TRUE(stage.device->stop_after_failure()) << "its end is not confirmed yet";
  stage.peer.serve(stage.time.now());  // no cycle of the device in between
  EXPECT_GT(stage.times_heard("AbortE()"), before);
  EXPECT_TRUE(stage.state_becomes(kHeld)) << stage.state();
  EXPECT_FALSE(stage.device->stop_after_failure());
  EXPECT_FALSE(stage.peer.machine().moving());
  EXPECT_TRUE(stage.device->held());
}

TEST(IppStop, AMachineThatStandsIsLeftAloneAfterAnException) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  EXPECT_FALSE(stage.device->stop_after_failure());
  stage.cycles_for(1s);
  EXPECT_EQ(stage.times_heard("AbortE()"), 0);
  EXPECT_EQ(stage.state(), "ready");
}

TEST(IppStop, AProcessThatEndsStopsTheMachineWithoutItsDevice) {
  MovingStage stage;
  stage.peer.serve(stage.time.now());
  const auto done = drivers::send_emergency_stops({});
  EXPECT_EQ(done.sent, 1);
  stage.peer.serve(stage.time.now());
  EXPECT_EQ(stage.times_heard("AbortE()"), 1);
  stage.time.advance(1s);
  stage.peer.serve(stage.time.now());
  EXPECT_FALSE(stage.peer.machine().moving());
}

TEST(IppStop, AnUnknownTagWhileMovingIsAbortedFirst) {
  MovingStage stage;
  stage.inject(sim::FaultKind::OddTag);
  stage.expect_stopped_and_held();
  EXPECT_THAT(stage.last_fault(), HasSubstr("asked to move while awaiting release"));
}

TEST(IppStop, ATimeOutWhileMovingIsAbortedFirst) {
  IppDeviceOptions options;
  options.session.motion_timeout = 500ms;
  MovingStage stage{options};
  ASSERT_TRUE(stage.cycles_until(2s, [&] { return stage.device->status().faults > 0; }));
  EXPECT_THAT(stage.last_fault(), HasSubstr("no answer to GoTo in 0.5 s"));
  stage.expect_stopped_and_held();
}

TEST(IppStop, GarbageWhileMovingIsAbortedFirst) {
  for (const std::string garbage : {"220 mail.example.com ESMTP\r\n", "\x01\x02 garbage\r\n",
                                    "\xE4\r\n", "00007 ! Error(2,\r\n"}) {
    MovingStage stage;
    stage.peer.send(garbage);
    ASSERT_TRUE(stage.cycles_until(1s, [&] { return stage.device->status().faults > 0; }));
    EXPECT_THAT(stage.last_fault(), HasSubstr("this is no I++ DME server"));
    stage.expect_stopped_and_held();
    EXPECT_FALSE(stage.device->status().connected);
  }
}

TEST(IppStop, ARequestStopsTheMotionAndDropsThePoints) {
  MovingStage stage;
  stage.device->measure(on_top());
  stage.device->abort();
  stage.expect_stopped_and_held();
}

TEST(IppStop, ARequestWithoutAMotionHoldsWithoutAnAbort) {
  for (const auto before : {0s, 1s, 5s}) {  // not connected, connected, ready
    IppStage stage;
    stage.cycles_for(before);
    stage.device->abort();
    stage.cycles_for(10s);
    EXPECT_EQ(stage.state(), kHeld);
    EXPECT_EQ(stage.times_heard("AbortE()"), 0);
    stage.device->release();
    EXPECT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  }
}

TEST(IppStop, AnEndByRequestStopsTheMotionAndHoldsNothing) {
  drivers::IppMachine kept;
  IppDeviceOptions options;
  options.machine_changed = [&](const drivers::IppMachine& m) { kept = m; };
  MovingStage stage{options};
  stage.device->measure(on_top());
  stage.device->end();

  ASSERT_TRUE(stage.cycles_until(10s, [&] { return stage.state() == "disconnected"; }))
      << stage.state();
  EXPECT_FALSE(stage.peer.machine().moving());
  EXPECT_EQ(stage.times_heard("AbortE()"), 1);
  EXPECT_EQ(stage.peer.machine().heard().back(), "EndSession()");
  EXPECT_FALSE(stage.device->held());
  EXPECT_EQ(kept, drivers::IppMachine{});
  stage.device->measure(on_top());
  stage.cycles_for(10s);
  EXPECT_EQ(stage.state(), "disconnected") << "nothing is begun any more";
  EXPECT_EQ(stage.device->points_left(), 0u);
}

TEST(IppStop, AMachineStoppedAfterAnExceptionIsHeldForIt) {
  MovingStage stage;
  EXPECT_TRUE(stage.device->stop_after_failure());
  ASSERT_TRUE(stage.state_becomes(kHeld)) << stage.state();
  EXPECT_THAT(stage.last_fault(), HasSubstr("stopped after an internal error"));
}

TEST(IppStop, AHoldByRequestOutlivesTheEndBeforeTheAnswer) {
  for (const bool lost : {false, true}) {
    drivers::IppMachine kept;
    IppDeviceOptions options;
    options.machine_changed = [&](const drivers::IppMachine& m) { kept = m; };
    MovingStage stage{options};
    if (lost) {
      stage.peer.hang_up();
      ASSERT_TRUE(stage.cycles_until(1s, [&] { return !stage.device->status().connected; }));
    }
    stage.device->abort();
    stage.device->end();

    ASSERT_TRUE(stage.cycles_until(10s, [&] { return stage.state() == "disconnected"; }))
        << stage.state();
    ASSERT_TRUE(stage.cycles_until(10s, [&] { return !kept.moving; }));
    EXPECT_FALSE(stage.peer.machine().moving());
    EXPECT_EQ(kept.held, "stopped by request");
  }
}

TEST(IppRelease, AMotionThatIsBeingStoppedCannotBeReleased) {
  MovingStage stage;
  stage.peer.hold_answers(true);
  stage.peer.send("E0000 ! Error(2,1001,Machine,\"Air pressure\")\r\n");
  ASSERT_TRUE(stage.cycles_until(1s, [&] { return stage.state() == "aborting"; })) << stage.state();
  EXPECT_TRUE(stage.device->held());
  EXPECT_FALSE(stage.device->releasable());
  stage.peer.hold_answers(false);
  ASSERT_TRUE(stage.cycles_until(10s, [&] { return stage.device->releasable(); })) << stage.state();
  stage.device->release();
  ASSERT_TRUE(stage.cycles_until(10s, [&] { return !stage.device->held(); })) << stage.state();
}

TEST(IppRelease, TheHoldOutlivesTheDevice) {
  std::string kept;
  IppDeviceOptions options;
  options.machine_changed = [&](const drivers::IppMachine& machine) { kept = machine.held; };

  {
    MovingStage stage{options};
    stage.inject(sim::FaultKind::EmergencyStop);
    ASSERT_TRUE(stage.state_becomes(kHeld));
  }

  EXPECT_THAT(kept, HasSubstr("0500 Emergency stop"));
  options.session.held = kept;
  IppStage stage{machine_with_a_sphere(), options};
  stage.cycles_for(60s);
  EXPECT_EQ(stage.state(), kHeld);
  EXPECT_THAT(stage.last_fault(), HasSubstr("0500 Emergency stop"));
  EXPECT_THAT(stage.peer.machine().heard(), testing::IsEmpty());
  stage.device->release();
  EXPECT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  EXPECT_EQ(kept, "");
}

TEST(IppStop, AMotionOnALostConnectionIsAbortedOnTheNextOne) {
  MovingStage stage;
  stage.peer.hang_up();
  ASSERT_TRUE(stage.cycles_until(1s, [&] { return !stage.device->status().connected; }));
  EXPECT_TRUE(stage.peer.machine().moving());
  stage.expect_stopped_and_held();
}

TEST(IppStop, AMotionOnALostConnectionIsAbortedBeforeASessionIsStarted) {
  MovingStage stage;
  const auto before = stage.commands();
  stage.peer.hang_up();
  ASSERT_TRUE(stage.state_becomes(kHeld));
  EXPECT_FALSE(stage.peer.machine().moving());
  EXPECT_THAT(stage.commands_after(before), testing::ElementsAre("AbortE()"));
  EXPECT_THAT(stage.last_fault(),
              HasSubstr("the connection was lost while the machine was moving"));
  stage.device->release();
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  EXPECT_EQ(stage.commands_after(before).at(1), "StartSession()");
}

TEST(IppStop, AServerThatAbortsOnlyInASessionGetsOneFirst) {
  sim::IppDmeOptions machine = machine_with_a_sphere();
  machine.aborts_outside_session = false;
  MovingStage stage{{}, machine};
  const auto before = stage.commands();
  stage.peer.hang_up();
  ASSERT_TRUE(stage.cycles_until(30s, [&] { return stage.state() == kHeld; }))
      << stage.last_fault();
  EXPECT_FALSE(stage.peer.machine().moving());
  const auto heard = stage.commands_after(before);
  ASSERT_GE(heard.size(), 3u);
  EXPECT_EQ(heard[0], "AbortE()");
  EXPECT_EQ(heard[1], "StartSession()");
  EXPECT_EQ(heard[2], "AbortE()");
}

/// The error came first, so the machine was held when the connection was lost.
TEST(IppStop, AHeldMachineThatMayStillMoveIsAbortedOnTheNextConnection) {
  MovingStage stage;
  stage.peer.hold_answers(true);
  stage.peer.send("E0000 ! Error(2,1001,Machine,\"Air pressure\")\r\n");
  ASSERT_TRUE(stage.cycles_until(1s, [&] { return stage.times_heard("AbortE()") == 1; }));
  const auto before = stage.commands();
  stage.peer.hang_up();
  stage.peer.hold_answers(false);
  ASSERT_TRUE(stage.cycles_until(10s, [&] { return stage.commands() > before; }));
  stage.cycles_for(10s);
  EXPECT_THAT(stage.commands_after(before), testing::ElementsAre("AbortE()"));
  EXPECT_EQ(stage.state(), kHeld);
  EXPECT_THAT(stage.last_fault(), HasSubstr("1001 Air pressure"));
}

TEST(IppStop, ARefusedAbortIsNoStandstill) {
  sim::IppDmeOptions machine = machine_with_a_sphere();
  machine.refuses_aborts = true;
  drivers::IppMachine kept;
  IppDeviceOptions options;
  options.machine_changed = [&](const drivers::IppMachine& m) { kept = m; };
  MovingStage stage{options, machine};
  const auto before = stage.commands();
  stage.device->abort();
  stage.cycles_for(30s);

  EXPECT_EQ(stage.state(), kHeld);
  EXPECT_THAT(stage.last_fault(), HasSubstr("AbortE was refused: 0500"));
  EXPECT_THAT(stage.last_fault(), HasSubstr("the machine may still be moving"));
  EXPECT_TRUE(kept.moving);
  EXPECT_THAT(stage.commands_after(before), testing::Each("AbortE()"));
  stage.device->release();
  EXPECT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
}

TEST(IppStop, GarbageBehindAnAbortDoesNotHideItsAnswer) {
  for (const std::string garbage : {"\x01\x02 garbage\r\n", "220 mail.example.com ESMTP\r\n"}) {
    MovingStage stage;
    stage.peer.hold_answers(true);
    stage.device->abort();
    ASSERT_TRUE(stage.cycles_until(1s, [&] { return stage.times_heard("AbortE()") == 1; }));
    stage.peer.send(garbage + "E0002 %\r\n");  // in one read
    ASSERT_TRUE(stage.cycles_until(1s, [&] { return stage.state() == kHeld; })) << stage.state();
    EXPECT_THAT(stage.last_fault(), Not(HasSubstr("no answer to AbortE")));
  }
}

TEST(IppRelease, TheReasonOfAHoldStaysAfterFurtherRefusals) {
  std::string kept;
  IppDeviceOptions options;
  options.machine_changed = [&](const drivers::IppMachine& machine) { kept = machine.held; };
  MovingStage stage{options};
  stage.inject(sim::FaultKind::EmergencyStop);
  stage.device->measure(on_top());
  ASSERT_TRUE(stage.state_becomes(kHeld));
  stage.device->measure(on_top());
  stage.cycles_for(1s);
  EXPECT_THAT(stage.last_fault(), HasSubstr("0500 Emergency stop"));
  EXPECT_THAT(stage.last_fault(), HasSubstr("asked to move while awaiting release"));
  EXPECT_EQ(kept, "reports 0500 Emergency stop (severity 3)");
}

TEST(IppStop, AMotionIsStoredBeforeItBeginsAndErasedAtStandstill) {
  std::vector<bool> moving;
  IppDeviceOptions options;
  options.machine_changed = [&](const drivers::IppMachine& m) { moving.push_back(m.moving); };
  MovingStage stage{options};
  EXPECT_THAT(moving, testing::ElementsAre(true));
  ASSERT_TRUE(stage.state_becomes("ready"));
  EXPECT_THAT(moving, testing::ElementsAre(true, false));
}

TEST(IppStop, AMotionOnALostConnectionOutlivesTheDevice) {
  drivers::IppMachine kept;
  IppDeviceOptions options;
  options.machine_changed = [&](const drivers::IppMachine& m) { kept = m; };
  MovingStage stage{options};
  stage.peer.hang_up();
  ASSERT_TRUE(stage.cycles_until(1s, [&] { return !stage.device->status().connected; }));
  stage.device.reset();
  EXPECT_TRUE(kept.moving);

  const auto before = stage.commands();
  options.port = stage.peer.port();
  options.session.held = "abbed ended while the machine was moving";
  options.session.moving = true;
  stage.device = IppDevice::create(options, stage.time).value();
  ASSERT_TRUE(stage.cycles_until(5s, [&] { return stage.commands() > before; }));
  stage.cycles_for(10s);
  EXPECT_EQ(stage.state(), kHeld);
  EXPECT_FALSE(stage.peer.machine().moving());
  EXPECT_THAT(stage.commands_after(before), testing::ElementsAre("AbortE()"));
  EXPECT_FALSE(kept.moving);
  EXPECT_THAT(kept.held, HasSubstr("abbed ended"));
  stage.device->release();
  EXPECT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  EXPECT_EQ(kept, drivers::IppMachine{});
}

TEST(IppStop, AnUnansweredAbortIsRepeatedOnTheNextConnection) {
  MovingStage stage;
  stage.peer.hold_answers(true);
  stage.device->abort();
  ASSERT_TRUE(stage.cycles_until(10s, [&] { return !stage.device->status().connected; }));
  EXPECT_THAT(stage.last_fault(),
              HasSubstr("no answer to AbortE in 3 s: the machine may still be moving"));
  stage.peer.hold_answers(false);
  ASSERT_TRUE(stage.state_becomes(kHeld)) << stage.state();
  EXPECT_EQ(stage.times_heard("AbortE()"), 2);
}

TEST(IppStop, HomingIsAbortedWhenTheDeviceEnds) {
  IppStage stage{not_homed(20s), that_may_home()};
  ASSERT_TRUE(stage.cycles_until(5s, [&] { return stage.peer.machine().moving(); }));
  stage.device.reset();
  stage.peer.serve(stage.time.now());
  EXPECT_FALSE(stage.peer.machine().moving());
  EXPECT_EQ(stage.times_heard("AbortE()"), 1);
}

/// A client that waits for the answer: in real time, the server in another thread.
TEST(IppStop, TheEndOfTheDeviceWaitsForTheAnswerToItsAbort) {
  drivers::MonotonicTime time;
  IppDmePeer peer{time.now(), machine_with_a_sphere()};
  IppDeviceOptions options;
  options.port = peer.port();
  auto device = IppDevice::create(options, time).value();
  std::atomic<bool> over{false};

  std::thread server([&] {
    while (!over) {
      peer.serve(time.now());
      peer.send_gathered();
    }
  });

  const auto cycles_until = [&](std::string_view state) {
    for (int i = 0; i < 10'000 && device->status().state != state; ++i) {
      device->wait(1ms);
      device->receive();
    }
    return device->status().state == state;
  };

  EXPECT_TRUE(cycles_until("ready"));
  device->measure({.position_m = {3.0, 4.0, 0.0}, .touch = false});
  EXPECT_TRUE(cycles_until("measuring"));
  device.reset();
  over = true;
  server.join();
  EXPECT_FALSE(peer.machine().moving());
  EXPECT_EQ(peer.machine().heard().back(), "EndSession()");
}

TEST(IppRelease, AnErrorOfSeverityTwoOrMoreHoldsTheMachine) {
  for (const int severity : {2, 3, 9}) {
    MovingStage stage;
    stage.inject(sim::FaultKind::ErrorReport, severity);
    ASSERT_TRUE(stage.cycles_until(1s, [&] { return stage.device->status().faults > 0; }));
    EXPECT_THAT(stage.last_fault(), HasSubstr("(severity " + std::to_string(severity) + ")"));
    stage.expect_stopped_and_held();
    EXPECT_TRUE(stage.device->status().connected);
  }
}

TEST(IppRelease, AWarningHoldsNothing) {
  for (const int severity : {0, 1}) {
    MovingStage stage;
    stage.inject(sim::FaultKind::ErrorReport, severity);
    ASSERT_TRUE(stage.cycles_until(10s, [&] { return stage.state() == "ready"; }));
    EXPECT_EQ(stage.device->status().faults, 0u);
    EXPECT_EQ(stage.times_heard("AbortE()"), 0);
  }
}

TEST(IppRelease, NothingMovesOrClearsAfterAnEmergencyStop) {
  MovingStage stage;
  stage.inject(sim::FaultKind::EmergencyStop);
  ASSERT_TRUE(stage.cycles_until(1s, [&] { return stage.device->status().faults > 0; }));
  EXPECT_THAT(stage.last_fault(), HasSubstr("0500 Emergency stop"));
  stage.expect_stopped_and_held();
}

TEST(IppRelease, ARefusedTouchHoldsTheMachineUntilAnOperatorReleasesIt) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  stage.device->measure({.position_m = {0.3, 0.3, 0.0}});

  ASSERT_TRUE(stage.state_becomes(kHeld));
  ASSERT_EQ(stage.touches.size(), 1u);
  EXPECT_TRUE(has(stage.touches[0].touch_flags, TouchFlag::NoPosition));
  EXPECT_TRUE(std::isnan(stage.touches[0].position[0]));
  EXPECT_THAT(stage.last_fault(), HasSubstr("1006 Surface not found"));
  EXPECT_EQ(stage.times_heard("ClearAllErrors()"), 0);
  stage.device->release();
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  EXPECT_EQ(stage.times_heard("ClearAllErrors()"), 1);
  stage.device->measure(on_top());
  ASSERT_TRUE(stage.cycles_until(60s, [&] { return stage.touches.size() == 2; }))
      << stage.last_fault();
  EXPECT_EQ(stage.touches[1].touch_flags, 0u);
}

TEST(IppRelease, TheHoldOutlivesTheConnectionAndThePowerOfTheServer) {
  MovingStage stage;
  stage.inject(sim::FaultKind::EmergencyStop);
  ASSERT_TRUE(stage.state_becomes(kHeld));
  stage.peer.restart(stage.time.now());
  stage.cycles_for(60s);
  EXPECT_EQ(stage.state(), kHeld);
  EXPECT_FALSE(stage.device->status().connected);
  EXPECT_THAT(stage.peer.machine().heard(), testing::IsEmpty());
  stage.device->release();
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
}

TEST(IppRelease, AReleaseWhileTheEmergencyStopIsPressedHoldsAgain) {
  MovingStage stage;
  stage.peer.machine().press_emergency_stop(stage.time.now(), stage.time.now() + 20s);
  ASSERT_TRUE(stage.state_becomes(kHeld));
  stage.device->release();
  stage.cycles_for(1s);
  ASSERT_EQ(stage.state(), kHeld);
  EXPECT_THAT(stage.last_fault(), HasSubstr("ClearAllErrors was refused: 0500 Emergency stop"));
  stage.cycles_for(20s);
  stage.device->release();
  EXPECT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
}

TEST(IppRelease, AReleaseWithoutAHoldDoesNothing) {
  MovingStage stage;
  stage.device->release();
  ASSERT_TRUE(stage.cycles_until(10s, [&] { return stage.state() == "ready"; }));
  EXPECT_EQ(stage.times_heard("ClearAllErrors()"), 0);
  EXPECT_EQ(stage.times_heard("AbortE()"), 0);
}

TEST(IppRelease, AMachineThatLostItsHomeIsNotSentHomeWithoutARelease) {
  IppStage stage{not_homed(1s), that_may_home()};
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  stage.peer.restart(stage.time.now());
  ASSERT_TRUE(stage.state_becomes(kHeld)) << stage.last_fault();
  EXPECT_THAT(stage.last_fault(), HasSubstr("not homed any more"));
  EXPECT_EQ(stage.times_heard("Home()"), 0);
  stage.device->release();
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  EXPECT_EQ(stage.times_heard("Home()"), 1);
}

TEST(IppDevice, AnErrorTextInAnyCharacterSetIsReadAndShownEscaped) {
  MovingStage stage;
  stage.inject(sim::FaultKind::NotAscii);
  ASSERT_TRUE(stage.cycles_until(10s, [&] { return stage.state() == "ready"; }));
  EXPECT_EQ(stage.device->status().faults, 0u);
  stage.peer.send("E0000 ! Error(2,1001,Maschine,\"Ber\xFChrung\")\r\n");
  ASSERT_TRUE(stage.state_becomes(kHeld));
  EXPECT_THAT(stage.last_fault(), HasSubstr("1001 Ber\\xFChrung (severity 2)"));
  EXPECT_TRUE(stage.device->status().connected);
}

}  // namespace
}  // namespace abbe::tests

/// What a request to stop the measuring machine is answered with.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "ippdme_stage.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::IppStop;
using drivers::IppStopOutcome;
using testing::HasSubstr;

/// The outcome of a stop that is requested now.
IppStop outcome_of_a_stop(IppStage& stage) {
  const auto number = stage.device->abort();
  EXPECT_TRUE(stage.cycles_until(30s, [&] {
    const IppStop seen = stage.device->last_stop();
    return seen.number == number && seen.outcome != IppStopOutcome::Pending;
  })) << stage.state();
  return stage.device->last_stop();
}

TEST(IppStopOutcomes, WithoutARequestThereIsNone) {
  const IppStage stage;
  EXPECT_EQ(stage.device->last_stop().outcome, IppStopOutcome::None);
}

TEST(IppStopOutcomes, AnAnsweredAbortIsAStop) {
  MovingStage stage;
  EXPECT_EQ(outcome_of_a_stop(stage).outcome, IppStopOutcome::Stopped);
  EXPECT_FALSE(stage.peer.machine().moving());
  EXPECT_EQ(outcome_of_a_stop(stage).outcome, IppStopOutcome::Stopped) << "again, at standstill";
  EXPECT_EQ(stage.times_heard("AbortE()"), 1);
}

TEST(IppStopOutcomes, AtStandstillNoMotionWasUnderWay) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready"));
  const IppStop stop = outcome_of_a_stop(stage);
  EXPECT_EQ(stop.outcome, IppStopOutcome::Stopped);
  EXPECT_THAT(stop.text, HasSubstr("no motion of abbed was under way"));
}

TEST(IppStopOutcomes, AnUnansweredAbortIsNotConfirmed) {
  MovingStage stage;
  stage.peer.hold_answers(true);
  const IppStop stop = outcome_of_a_stop(stage);
  EXPECT_EQ(stop.outcome, IppStopOutcome::NotConfirmed);
  EXPECT_THAT(stop.text, HasSubstr("no answer to AbortE in 3 s: the machine may still be moving"));
  EXPECT_THAT(stage.device->status().condition, HasSubstr("the machine may be moving"));
  stage.peer.hold_answers(false);
  ASSERT_TRUE(stage.state_becomes(kHeld));
  EXPECT_TRUE(stage.cycles_until(10s, [&] { return stage.device->status().condition.empty(); }))
      << stage.device->status().condition;
}

TEST(IppStopOutcomes, ARefusedAbortIsNotConfirmed) {
  sim::IppDmeOptions machine = machine_with_a_sphere();
  machine.refuses_aborts = true;
  MovingStage stage{{}, machine};
  const IppStop stop = outcome_of_a_stop(stage);
  EXPECT_EQ(stop.outcome, IppStopOutcome::NotConfirmed);
  EXPECT_THAT(stop.text, HasSubstr("AbortE was refused: 0500"));
}

TEST(IppStopOutcomes, AConnectionLostBeforeTheAnswerIsNotConfirmed) {
  MovingStage stage;
  stage.peer.hold_answers(true);
  const auto number = stage.device->abort();
  ASSERT_TRUE(stage.cycles_until(1s, [&] { return stage.times_heard("AbortE()") == 1; }));
  stage.peer.hang_up();
  ASSERT_TRUE(stage.cycles_until(
      1s, [&] { return stage.device->last_stop().outcome == IppStopOutcome::NotConfirmed; }));
  EXPECT_EQ(stage.device->last_stop().number, number);
  EXPECT_THAT(stage.device->last_stop().text, HasSubstr("the machine may be moving"));
}

TEST(IppStopOutcomes, WithoutAConnectionItIsNotSent) {
  MovingStage stage;
  stage.peer.unplug();
  ASSERT_TRUE(stage.cycles_until(1s, [&] { return !stage.device->status().connected; }));
  const IppStop stop = outcome_of_a_stop(stage);
  EXPECT_EQ(stop.outcome, IppStopOutcome::NotSent);
  EXPECT_THAT(stop.text, HasSubstr("the machine may be moving"));
  EXPECT_TRUE(stage.peer.machine().moving());
  EXPECT_THAT(stage.device->status().condition, HasSubstr("the machine may be moving"));
}

TEST(IppStopOutcomes, OfAMachineThatWasNeverConnectedItIsNotSent) {
  IppStage stage;
  stage.peer.unplug();
  stage.cycles_for(1s);
  EXPECT_EQ(outcome_of_a_stop(stage).outcome, IppStopOutcome::NotSent);
}

TEST(IppStopOutcomes, AfterALostConnectionTheNextOneIsOpenedAtOnceForIt) {
  MovingStage stage;
  stage.peer.hang_up();
  ASSERT_TRUE(stage.cycles_until(1s, [&] { return !stage.device->status().connected; }));
  EXPECT_EQ(outcome_of_a_stop(stage).outcome, IppStopOutcome::Stopped);
  EXPECT_FALSE(stage.peer.machine().moving());
}

TEST(IppStopOutcomes, ASecondRequestSendsAnAbortAgainThatWasRefused) {
  sim::IppDmeOptions machine = machine_with_a_sphere();
  machine.refuses_aborts = true;
  MovingStage stage{{}, machine};
  EXPECT_EQ(outcome_of_a_stop(stage).outcome, IppStopOutcome::NotConfirmed);
  stage.cycles_for(30s);
  const auto aborts = stage.times_heard("AbortE()");
  EXPECT_EQ(outcome_of_a_stop(stage).outcome, IppStopOutcome::NotConfirmed);
  EXPECT_EQ(stage.times_heard("AbortE()"), aborts + 1);
}

TEST(IppStopOutcomes, RequestsThatArriveOutOfOrderHaveTheHighestNumber) {
  drivers::IppSession session{drivers::IppSessionOptions{}};
  (void)session.on(drivers::IppAbortRequested{.number = 2}, {});
  (void)session.on(drivers::IppAbortRequested{.number = 1}, {});
  EXPECT_EQ(session.stop().number, 2u);
  EXPECT_EQ(session.stop().outcome, IppStopOutcome::NotSent);
}

TEST(IppStopOutcomes, AnInternalErrorKeepsTheNumberOfARequest) {
  MovingStage stage;
  stage.peer.hold_answers(true);
  const auto number = stage.device->abort();
  stage.cycle();
  EXPECT_TRUE(stage.device->stop_after_failure());
  stage.peer.hold_answers(false);
  ASSERT_TRUE(stage.state_becomes(kHeld)) << stage.state();
  EXPECT_EQ(stage.device->last_stop().number, number);
  EXPECT_EQ(stage.device->last_stop().outcome, IppStopOutcome::Stopped);
}

/// The end of the device in real time, with the server in another thread.
IppStop end_of(sim::IppDmeOptions machine, bool lose_the_connection, bool& moves_on) {
  drivers::MonotonicTime time;
  IppDmePeer peer{time.now(), std::move(machine)};
  drivers::IppDeviceOptions options;
  options.port = peer.port();
  options.session.command_timeout = 500ms;
  auto device = drivers::IppDevice::create(options, time).value();

  const auto cycles_until = [&](std::string_view state) {
    for (int i = 0; i < 10'000 && device->status().state != state; ++i) {
      peer.serve(time.now());
      peer.send_gathered();
      device->wait(1ms);
      device->receive();
    }
  };
  cycles_until("ready");
  device->measure({.position_m = {3.0, 4.0, 0.0}, .touch = false});
  cycles_until("measuring");
  peer.serve(time.now());
  if (lose_the_connection) {
    peer.unplug();
    cycles_until("disconnected");
  }

  std::atomic<bool> over{false};
  std::thread server([&] {
    while (!over) {
      peer.serve(time.now());
      peer.send_gathered();
    }
  });
  const IppStop stop = device->finish();
  over = true;
  server.join();
  moves_on = peer.machine().moving();
  return stop;
}

TEST(IppStopOutcomes, TheEndOfTheDeviceReportsWhetherTheMachineStopped) {
  bool moves_on = true;
  EXPECT_EQ(end_of(machine_with_a_sphere(), false, moves_on).outcome, IppStopOutcome::Stopped);
  EXPECT_FALSE(moves_on);

  sim::IppDmeOptions refusing = machine_with_a_sphere();
  refusing.refuses_aborts = true;
  EXPECT_EQ(end_of(refusing, false, moves_on).outcome, IppStopOutcome::NotConfirmed);
  EXPECT_TRUE(moves_on);

  sim::IppDmeOptions mute = machine_with_a_sphere();
  mute.answers_aborts = false;
  EXPECT_EQ(end_of(mute, false, moves_on).outcome, IppStopOutcome::NotConfirmed);

  EXPECT_EQ(end_of(machine_with_a_sphere(), true, moves_on).outcome, IppStopOutcome::NotSent);
  EXPECT_TRUE(moves_on);
}

}  // namespace
}  // namespace abbe::tests

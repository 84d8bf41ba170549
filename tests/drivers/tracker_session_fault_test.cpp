/// What goes wrong with a tracker: before points come, in the connection, with the beam.

#include <cstring>

#include "tracker_session_fixture.hpp"

namespace abbe::drivers {
namespace {

// --- what goes wrong before points come ----------------------------------------------------------

TEST_F(TrackerSessionTest, WaitsForAHeatingLaserAndAsksAgain) {
  connect();
  emscon::SystemStatusAnswer heating;
  heating.laser = emscon::LaserStatus::Heating;
  on(emscon::Answer{heating});
  EXPECT_EQ(session_.state(), TrackerState::WaitWarm);
  tick_after(options_.warm_poll);
  EXPECT_THAT(sent_, ElementsAre(Command::GetSystemStatus, Command::GetSystemStatus));
  pass_query();
  EXPECT_EQ(session_.state(), TrackerState::Configuring);
  EXPECT_EQ(session_.fault().count, 0u);
}

TEST_F(TrackerSessionTest, ContinuesAtOnceWhenTheLaserReportsReady) {
  connect();
  emscon::SystemStatusAnswer heating;
  heating.laser = emscon::LaserStatus::Heating;
  on(emscon::Answer{heating});
  say(Event::LaserWarmedUp);
  EXPECT_EQ(sent_.size(), 2u);
}

TEST_F(TrackerSessionTest, WaitsForTheLaserWhenACommandReportsItNotReady) {
  connect();
  pass_query();
  answer_until(Command::Initialize);
  answer(Status::NotWarmedUp);
  EXPECT_EQ(session_.state(), TrackerState::WaitWarm);
}

struct DeadLaser {
  const char* name;
  emscon::LaserStatus status;
};
class TrackerSessionLaser : public TrackerSessionTest,
                            public testing::WithParamInterface<DeadLaser> {};
TEST_P(TrackerSessionLaser, ThatCannotMeasureIsAFault) {
  connect();
  emscon::SystemStatusAnswer status;
  status.laser = GetParam().status;
  on(emscon::Answer{status});
  EXPECT_TRUE(closed());
  EXPECT_EQ(session_.state(), TrackerState::Faulted);
  EXPECT_THAT(session_.fault().text, HasSubstr("laser"));
}
INSTANTIATE_TEST_SUITE_P(Dead, TrackerSessionLaser,
                         testing::Values(DeadLaser{"Mute",
                                                   emscon::LaserStatus::CommunicationFailed},
                                         DeadLaser{"Unable", emscon::LaserStatus::Unable},
                                         DeadLaser{"Off", emscon::LaserStatus::Off}),
                         [](const auto& laser) { return laser.param.name; });

TEST_F(TrackerSessionTest, ACommandWithoutAnswerIsAFaultAfterThreeSeconds) {
  connect();
  pass_query();
  tick_after(2999ms);
  EXPECT_TRUE(nothing());
  tick_after(1ms);
  EXPECT_TRUE(closed());
  EXPECT_EQ(session_.state(), TrackerState::Faulted);
  EXPECT_EQ(session_.fault().text, "tracker 10.0.0.7:700: no answer to SetUnits in 3 s");
}

TEST_F(TrackerSessionTest, RepeatsTheFirstCommandUntilARestartedControllerAnswers) {
  connect();
  tick_after(options_.ask_again);
  tick_after(options_.ask_again);
  EXPECT_THAT(sent_, ElementsAre(Command::GetSystemStatus, Command::GetSystemStatus,
                                 Command::GetSystemStatus));
  pass_query();
  EXPECT_EQ(session_.state(), TrackerState::Configuring);
  EXPECT_EQ(session_.fault().count, 0u);
}

TEST_F(TrackerSessionTest, AControllerThatNeverAnswersIsAFaultAfterThreeSeconds) {
  connect();
  let_pass(2999ms);
  EXPECT_EQ(session_.state(), TrackerState::Querying);
  let_pass(1ms);
  EXPECT_EQ(session_.fault().text, "tracker 10.0.0.7:700: no answer to GetSystemStatus in 3 s");
}

TEST_F(TrackerSessionTest, InitializeMayTakeTwoMinutes) {
  connect();
  pass_query();
  answer_until(Command::Initialize);
  tick_after(119s);
  EXPECT_EQ(session_.state(), TrackerState::Initialising);
  tick_after(1s);
  EXPECT_THAT(session_.fault().text, HasSubstr("no answer to Initialize in 120 s"));
}

TEST_F(TrackerSessionTest, ABusyServerIsAskedAgain) {
  connect();
  pass_query();
  answer(Status::ServerBusy);
  EXPECT_TRUE(nothing());
  tick_after(options_.busy_retry);
  EXPECT_EQ(sent_.back(), Command::SetUnits);
  answer();
  EXPECT_EQ(sent_.back(), Command::SetSystemSettings);
  EXPECT_EQ(session_.fault().count, 0u);
}

TEST_F(TrackerSessionTest, AServerBusyForEverIsAFault) {
  connect();
  pass_query();
  for (int i = 0; i < 1000 && answer(Status::ServerBusy).index() == TrackerAction{}.index(); ++i)
    tick_after(options_.busy_retry);
  EXPECT_EQ(session_.state(), TrackerState::Faulted);
  EXPECT_THAT(session_.fault().text, HasSubstr("SetUnits was refused: server busy (1)"));
}

TEST_F(TrackerSessionTest, ARefusalIsReportedWithCommandAndReason) {
  connect();
  pass_query();
  answer_until(Command::SetCoordinateSystemType);
  answer(Status::TrackerNotInitialized);
  EXPECT_TRUE(closed());
  EXPECT_EQ(
      session_.fault().text,
      "tracker 10.0.0.7:700: SetCoordinateSystemType was refused: tracker not initialised (39)");
}

TEST_F(TrackerSessionTest, AParameterOutOfRangeButAcceptedIsNoFault) {
  connect();
  pass_query();
  answer(static_cast<Status>(13));
  EXPECT_EQ(sent_.back(), Command::SetSystemSettings);
}

TEST_F(TrackerSessionTest, CommandsUnknownToAnOlderControllerAreLeftOut) {
  connect();
  pass_query();
  answer_until(Command::SetStatisticMode);
  answer(Status::NotImplemented);
  answer_until(Command::SetLongSystemParameter);
  answer(Status::NotImplemented);
  EXPECT_EQ(sent_.back(), Command::StartMeasurement);
}

TEST_F(TrackerSessionTest, MalformedBytesAreReportedWithTheirContent) {
  connect();
  TrackerProtocolError nonsense;
  nonsense.length = 8;
  std::memcpy(nonsense.first_bytes.data(), "HTTP/1.1", 8);
  on(nonsense);
  EXPECT_TRUE(closed());
  EXPECT_EQ(session_.state(), TrackerState::Faulted);
  EXPECT_THAT(session_.fault().text, HasSubstr("tracker 10.0.0.7:700: expected emScon answer, got "
                                               "48 54 54 50 2f 31 2e 31 \"HTTP/1.1\""));
}

TEST_F(TrackerSessionTest, ASecondClientIsRefusedWithTheReason) {
  connect();
  on(emscon::ErrorResponse{Command::GetSystemStatus, Status::MultipleConnectionsNotAllowed});
  EXPECT_TRUE(closed());
  EXPECT_THAT(session_.fault().text, HasSubstr("another client is connected"));
}

// --- reconnecting --------------------------------------------------------------------------------

TEST_F(TrackerSessionTest, AConnectionAttemptTimesOut) {
  on(TrackerTick{});
  tick_after(options_.connect_timeout);
  EXPECT_TRUE(closed());
  EXPECT_EQ(session_.state(), TrackerState::Disconnected);
  EXPECT_THAT(session_.fault().text, HasSubstr("no connection in 3 s"));
}

TEST_F(TrackerSessionTest, PausesDoubleUpToTheLongest) {
  std::vector<std::chrono::nanoseconds> pauses;
  for (int i = 0; i < 4; ++i) {
    on(TrackerTick{});
    ASSERT_TRUE(std::holds_alternative<TrackerOpen>(action_));
    on(TrackerConnectionLost{"connection refused"});
    pauses.push_back(session_.deadline() - now_);
    now_ = session_.deadline();
  }
  EXPECT_THAT(pauses, ElementsAre(250ms, 500ms, 500ms, 500ms));
}

TEST_F(TrackerSessionTest, PausesAreShortAgainOncePointsArrive) {
  for (int i = 0; i < 5; ++i) {
    on(TrackerTick{});
    on(TrackerConnectionLost{"connection refused"});
    now_ = session_.deadline();
  }
  reach_streaming();
  on(TrackerConnectionLost{"closed"});
  EXPECT_EQ(session_.deadline() - now_, options_.first_pause);
}

TEST_F(TrackerSessionTest, ARestartedServerIsSetUpAgain) {
  reach_streaming();
  say(Event::ServerStarted);
  EXPECT_THAT(sent_, ElementsAre(Command::GetSystemStatus));
}

TEST_F(TrackerSessionTest, AClosingServerIsDisconnectedAndReconnected) {
  reach_streaming();
  say(Event::ServerClosing);
  EXPECT_TRUE(closed());
  EXPECT_EQ(session_.state(), TrackerState::Disconnected);
  let_pass(options_.first_pause);
  EXPECT_EQ(session_.state(), TrackerState::Connecting);
}

// --- streaming and the beam ----------------------------------------------------------------------

TEST_F(TrackerSessionTest, SilenceWhileStreamingIsAFault) {
  reach_streaming();
  let_pass(1499ms);
  on(TrackerPointsArrived{1});
  let_pass(1499ms);
  EXPECT_EQ(session_.state(), TrackerState::Streaming);
  let_pass(1ms);
  EXPECT_EQ(session_.state(), TrackerState::Faulted);
  EXPECT_THAT(session_.fault().text, HasSubstr("no points in 1.5 s"));
}

TEST_F(TrackerSessionTest, DuringALostBeamTheControllerIsPolled) {
  reach_streaming();
  on(emscon::ErrorResponse{Command::StartMeasurement, Status::Unknown});
  EXPECT_EQ(session_.state(), TrackerState::BeamLost);
  for (int i = 0; i < 12; ++i) {
    let_pass(options_.keep_alive);
    on(emscon::Answer{emscon::TrackerStatusAnswer{Status::Ok, emscon::TrackerStatus::NotReady}});
  }
  EXPECT_EQ(session_.state(), TrackerState::BeamLost);
  EXPECT_THAT(sent_, testing::Each(Command::GetTrackerStatus));
  EXPECT_EQ(session_.fault().count, 0u);
}

TEST_F(TrackerSessionTest, AControllerThatStopsDuringALostBeamIsAFault) {
  reach_streaming();
  say(Event::MeasurementNotReady);
  let_pass(options_.keep_alive + options_.command_timeout);
  EXPECT_EQ(session_.state(), TrackerState::Faulted);
}

TEST_F(TrackerSessionTest, AKeepAliveThatFallsDueWhileAnAnswerIsAwaitedIsNoDeadline) {
  reach_streaming();
  say(Event::MeasurementNotReady);  // the keep-alive is due at 5 s
  let_pass(3900ms);
  say(Event::MeasurementReady);
  let_pass(1s);
  ASSERT_THAT(sent_, ElementsAre(Command::StartMeasurement));
  tick_after(200ms);
  EXPECT_GT(session_.deadline(), now_);
}

TEST_F(TrackerSessionTest, PointsAfterTheBeamIsBackAreEnough) {
  reach_streaming();
  say(Event::MeasurementNotReady);
  let_pass(1s);
  say(Event::MeasurementReady);
  let_pass(100ms);
  on(TrackerPointsArrived{10});
  EXPECT_EQ(session_.state(), TrackerState::Streaming);
  let_pass(1400ms);
  EXPECT_TRUE(sent_.empty());
}

TEST_F(TrackerSessionTest, MeasuringIsStartedAgainIfNoPointsFollowTheBeam) {
  reach_streaming();
  say(Event::MeasurementNotReady);
  let_pass(200ms);
  say(Event::DistanceSet);
  let_pass(999ms);
  EXPECT_TRUE(sent_.empty());
  let_pass(1ms);
  EXPECT_THAT(sent_, ElementsAre(Command::StartMeasurement));
  answer();
  EXPECT_EQ(session_.state(), TrackerState::Streaming);
}

TEST_F(TrackerSessionTest, PointsFromBeforeTheBreakDoNotEndIt) {
  reach_streaming();
  say(Event::MeasurementNotReady);
  let_pass(300ms);
  on(TrackerPointsArrived{150});  // the burst that was being gathered
  EXPECT_EQ(session_.state(), TrackerState::BeamLost);
}

TEST_F(TrackerSessionTest, AMissedReadyEventIsReplacedByAStatusRequest) {
  reach_streaming();
  say(Event::MeasurementNotReady);
  let_pass(options_.keep_alive);
  on(emscon::Answer{emscon::TrackerStatusAnswer{Status::Ok, emscon::TrackerStatus::Ready}});
  let_pass(options_.resume_within);
  EXPECT_THAT(sent_, ElementsAre(Command::GetTrackerStatus, Command::StartMeasurement));
}

TEST_F(TrackerSessionTest, AMeasurementThatStillRunsIsStoppedAndStartedAgain) {
  reach_streaming();
  say(Event::MeasurementNotReady);
  say(Event::MeasurementReady);
  let_pass(options_.resume_within);
  answer(Status::UsageConflict);
  answer();  // StopMeasurement
  on(emscon::Answer{emscon::TrackerStatusAnswer{Status::Ok, emscon::TrackerStatus::Ready}});
  let_pass(options_.resume_within);
  EXPECT_THAT(sent_, ElementsAre(Command::StartMeasurement, Command::StopMeasurement,
                                 Command::GetTrackerStatus, Command::StartMeasurement));
  EXPECT_EQ(session_.fault().count, 0u);
}

TEST_F(TrackerSessionTest, ABeamLostAgainIsNotStarted) {
  reach_streaming();
  say(Event::MeasurementNotReady);
  say(Event::MeasurementReady);
  say(Event::MeasurementNotReady);
  let_pass(options_.resume_within);
  EXPECT_TRUE(sent_.empty());
}

}  // namespace
}  // namespace abbe::drivers

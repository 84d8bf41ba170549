/// The course of a tracker session as it should go: set-up, stop, the other modes.

#include "tracker_session_fixture.hpp"

namespace abbe::drivers {
namespace {

TEST_F(TrackerSessionTest, ConnectsAtOnce) {
  EXPECT_LE(session_.deadline(), now_);
  on(TrackerTick{});
  EXPECT_TRUE(std::holds_alternative<TrackerOpen>(action_));
  EXPECT_EQ(session_.state(), TrackerState::Connecting);
}

TEST_F(TrackerSessionTest, AsksInTheOrderOfTheManual) {
  connect();
  pass_query();
  answer_until(Command::StartMeasurement);
  EXPECT_THAT(sent_, ElementsAre(Command::GetSystemStatus, Command::GetUnits,
                                 Command::GetCoordinateSystemType, Command::GetStatisticMode,
                                 Command::GetMeasurementMode, Command::GetContinuousTimeModeParams,
                                 Command::GetLongSystemParameter, Command::GetSystemSettings,
                                 Command::SetUnits, Command::SetSystemSettings, Command::Initialize,
                                 Command::SetCoordinateSystemType, Command::SetStatisticMode,
                                 Command::SetMeasurementMode, Command::SetContinuousTimeModeParams,
                                 Command::SetLongSystemParameter, Command::StartMeasurement));
}

TEST_F(TrackerSessionTest, ShowsEachStateOnTheWay) {
  connect();
  EXPECT_EQ(session_.state(), TrackerState::Querying);
  pass_query();
  EXPECT_EQ(session_.state(), TrackerState::Configuring);
  answer_until(Command::Initialize);
  EXPECT_EQ(session_.state(), TrackerState::Initialising);
  answer();
  EXPECT_EQ(session_.state(), TrackerState::Configuring);
  answer_until(Command::StartMeasurement);
  EXPECT_EQ(session_.state(), TrackerState::Ready);
  answer();
  EXPECT_EQ(session_.state(), TrackerState::Streaming);
}

TEST_F(TrackerSessionTest, AsksForMillimetresAndUnsolicitedMessages) {
  connect();
  pass_query();
  const auto* units = std::get_if<emscon::SetUnits>(&std::get<TrackerSend>(action_).request);
  ASSERT_NE(units, nullptr);
  EXPECT_EQ(units->units.length, emscon::LengthUnit::Millimetre);
  EXPECT_EQ(units->units.temperature, emscon::TemperatureUnit::Celsius);
  answer();
  const auto* settings =
      std::get_if<emscon::SetSystemSettings>(&std::get<TrackerSend>(action_).request);
  ASSERT_NE(settings, nullptr);
  EXPECT_TRUE(settings->settings.send_unsolicited_messages);
  EXPECT_TRUE(settings->settings.keep_last_position);
}

TEST_F(TrackerSessionTest, SendsOneCommandAtATime) {
  connect();
  on(TrackerTick{});
  EXPECT_TRUE(nothing());
  on(emscon::Answer{emscon::Acknowledge{Command::Initialize, Status::Ok}});  // not what was asked
  EXPECT_TRUE(nothing());
  EXPECT_THAT(sent_, ElementsAre(Command::GetSystemStatus));
}

// --- stopping ------------------------------------------------------------------------------------

TEST_F(TrackerSessionTest, StopsAMeasurementThenClosesAndStaysDisconnected) {
  reach_streaming();
  on(TrackerStopRequested{});
  EXPECT_EQ(session_.state(), TrackerState::Stopping);
  EXPECT_THAT(sent_, ElementsAre(Command::StopMeasurement));
  answer();
  EXPECT_TRUE(closed());
  EXPECT_EQ(session_.state(), TrackerState::Disconnected);
  tick_after(1h);
  EXPECT_TRUE(nothing());
}

TEST_F(TrackerSessionTest, StopsWithoutAnAnswerToo) {
  reach_streaming();
  on(TrackerStopRequested{});
  tick_after(options_.command_timeout);
  EXPECT_TRUE(closed());
  EXPECT_EQ(session_.state(), TrackerState::Disconnected);
}

TEST_F(TrackerSessionTest, ADeadlineInThePastIsNeverLeftBehindByATick) {
  reach_streaming();
  for (int i = 0; i < 100; ++i) {
    now_ = std::max(now_, session_.deadline());
    on(TrackerTick{});
    ASSERT_GT(session_.deadline(), now_) << name_of(session_.state());
  }
}

// --- the other modes -----------------------------------------------------------------------------

class StationarySession : public TrackerSessionTest {
 protected:
  StationarySession() : TrackerSessionTest(stationary()) {}
  static TrackerSessionOptions stationary() {
    TrackerSessionOptions o;
    o.mode = TrackerMode::Stationary;
    o.reflector = "3";
    o.home_after_initialize = true;
    o.weather = emscon::WeatherMonitor::None;
    return o;
  }
};

TEST_F(StationarySession, SetsUpEnvironmentReflectorAndMode) {
  connect();
  pass_query();
  answer_until(Command::StartMeasurement);
  sent_.erase(sent_.begin(), std::find(sent_.begin(), sent_.end(), Command::SetUnits));
  EXPECT_THAT(
      sent_,
      ElementsAre(Command::SetUnits, Command::SetSystemSettings, Command::SetEnvironmentParams,
                  Command::Initialize, Command::GetReflector, Command::GetReflectors,
                  Command::SetReflector, Command::GoBirdBath, Command::SetCoordinateSystemType,
                  Command::SetStatisticMode, Command::SetMeasurementMode,
                  Command::SetStationaryModeParams, Command::StartMeasurement));
}

TEST_F(StationarySession, MeasuresOnePointAfterTheOther) {
  connect();
  pass_query();
  answer_until(Command::StartMeasurement);
  answer();
  on(TrackerPointsArrived{1});
  EXPECT_EQ(std::count(sent_.begin(), sent_.end(), Command::StartMeasurement), 2);
  EXPECT_EQ(session_.state(), TrackerState::Ready);
  answer();
  EXPECT_EQ(session_.state(), TrackerState::Streaming);
  let_pass(2900ms);
  EXPECT_EQ(session_.fault().count, 0u);
}

class DistanceSession : public TrackerSessionTest {
 protected:
  DistanceSession() : TrackerSessionTest(distance()) {}
  static TrackerSessionOptions distance() {
    TrackerSessionOptions o;
    o.mode = TrackerMode::ContinuousDistance;
    return o;
  }
};

TEST_F(DistanceSession, AMachineThatStandsStillIsNoFault) {
  reach_streaming();
  for (int i = 0; i < 5; ++i) {
    let_pass(options_.keep_alive);
    EXPECT_EQ(sent_.back(), Command::GetTrackerStatus);
    on(emscon::Answer{emscon::TrackerStatusAnswer{Status::Ok, emscon::TrackerStatus::Ready}});
  }
  EXPECT_EQ(session_.state(), TrackerState::Streaming);
  let_pass(options_.keep_alive + options_.command_timeout);
  EXPECT_EQ(session_.state(), TrackerState::Faulted);
}

TEST(TrackerSessionOptions, OutOfRangeIsRefusedByName) {
  TrackerSessionOptions options;
  EXPECT_TRUE(check(options));
  options.time_separation_ms = 0;
  ASSERT_FALSE(check(options));
  EXPECT_THAT(check(options).error().text, HasSubstr("time separation"));
  options = {};
  options.packets_per_second = 11;
  EXPECT_EQ(check(options).error().code, ErrorCode::BadConfiguration);
}

}  // namespace
}  // namespace abbe::drivers

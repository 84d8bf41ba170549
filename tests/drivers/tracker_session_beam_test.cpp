/// The beam belongs to who carries the reflector: what a session must not do to it, and what it
/// does on order.

#include <limits>

#include "tracker_session_fixture.hpp"

namespace abbe::drivers {
namespace {

using emscon::TrackerProcessorStatus;
using testing::Contains;
using testing::Not;

TEST_F(TrackerSessionTest, DoesNotInitializeWhatIsInitialised) {
  connect();
  pass_query(TrackerProcessorStatus::Initialised);
  answer_until(Command::StartMeasurement);
  EXPECT_EQ(sent_.back(), Command::StartMeasurement);
  EXPECT_THAT(sent_, Not(Contains(Command::Initialize)));
}

TEST_F(TrackerSessionTest, AReconnectDoesNotInitialize) {
  reach_streaming();
  on(TrackerConnectionLost{"cable out"});
  now_ = session_.deadline();
  connect();
  pass_query(TrackerProcessorStatus::Initialised);
  answer_until(Command::StartMeasurement);
  EXPECT_EQ(sent_.back(), Command::StartMeasurement);
  EXPECT_THAT(sent_, Not(Contains(Command::Initialize)));
}

class RefusedStart : public TrackerSessionTest, public testing::WithParamInterface<Status> {};
TEST_P(RefusedStart, WaitsForTheBeamAndSendsNothing) {
  connect();
  pass_query(TrackerProcessorStatus::Initialised);
  answer_until(Command::StartMeasurement);
  sent_.clear();
  on(emscon::Answer{emscon::Acknowledge{Command::StartMeasurement, GetParam()}});
  EXPECT_EQ(session_.state(), TrackerState::WaitBeam);
  EXPECT_THAT(session_.cause(), HasSubstr("StartMeasurement was refused"));
  EXPECT_THAT(session_.cause(), HasSubstr("bring the reflector to the beam"));

  for (int i = 0; i < 60; ++i) {  // five minutes
    let_pass(options_.keep_alive);
    on(emscon::Answer{emscon::TrackerStatusAnswer{Status::Ok, emscon::TrackerStatus::NotReady}});
  }

  EXPECT_EQ(session_.state(), TrackerState::WaitBeam);
  EXPECT_THAT(sent_, testing::Each(Command::GetTrackerStatus));
  EXPECT_EQ(session_.fault().count, 0u);
  say(Event::DistanceSet);
  let_pass(options_.resume_within);
  EXPECT_EQ(sent_.back(), Command::StartMeasurement);
  answer();
  EXPECT_EQ(session_.state(), TrackerState::Streaming);
  EXPECT_EQ(session_.cause(), "");
}
INSTANTIATE_TEST_SUITE_P(ForWantOfABeam, RefusedStart,
                         testing::Values(Status::NoDistanceSet, Status::MeasurementNotReady,
                                         Status::SystemNotReady));

TEST_F(TrackerSessionTest, ALostBeamNamesItsCause) {
  reach_streaming();
  say(Event::MeasurementNotReady);
  EXPECT_THAT(session_.cause(), HasSubstr("not ready to measure"));
  EXPECT_THAT(session_.cause(), HasSubstr("bring the reflector"));
}

// --- orders

TEST_F(TrackerSessionTest, AnOrderStopsTheMeasurementAndStartsItAgain) {
  reach_streaming();
  on(TrackerOrder{TrackerOrder::What::GoHome, 7, "", 0.0});

  EXPECT_EQ(session_.state(), TrackerState::Moving);
  EXPECT_THAT(session_.cause(), HasSubstr("\"home\" was asked for"));
  answer_until(Command::StartMeasurement);
  EXPECT_THAT(
      sent_, ElementsAre(Command::StopMeasurement, Command::GoBirdBath, Command::StartMeasurement));
  const auto report = session_.take_report();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->number, 7u);
  EXPECT_TRUE(report->done()) << report->text;
  answer();
  EXPECT_EQ(session_.state(), TrackerState::Streaming);
}

TEST_F(TrackerSessionTest, ARefusedOrderReportsTheReasonAndTheMeasurementContinues) {
  reach_streaming();
  on(TrackerOrder{TrackerOrder::What::FindReflector, 8, "", 2.5});
  answer_until(Command::FindReflector);
  const auto& find = std::get<emscon::FindReflector>(std::get<TrackerSend>(action_).request);
  EXPECT_EQ(find.approximate_distance, 2500.0);
  answer(Status::NoDistanceSet);
  const auto report = session_.take_report();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->outcome, TrackerOrderReport::Outcome::Refused);
  EXPECT_THAT(report->text, HasSubstr("FindReflector was refused: no distance set"));
  EXPECT_EQ(sent_.back(), Command::StartMeasurement);
  EXPECT_EQ(session_.fault().count, 0u);
}

TEST_F(TrackerSessionTest, AnOrderWaitsForTheOutstandingReply) {
  reach_streaming();
  say(Event::MeasurementNotReady);
  let_pass(options_.keep_alive);
  on(TrackerOrder{TrackerOrder::What::Initialize, 9, "", 0.0});
  EXPECT_THAT(sent_, ElementsAre(Command::GetTrackerStatus));
  on(emscon::Answer{emscon::TrackerStatusAnswer{Status::Ok, emscon::TrackerStatus::NotReady}});
  on(TrackerTick{});
  answer_until(Command::StartMeasurement);
  EXPECT_THAT(sent_, ElementsAre(Command::GetTrackerStatus, Command::StopMeasurement,
                                 Command::Initialize, Command::StartMeasurement));
  EXPECT_TRUE(session_.take_report()->done());
}

TEST_F(TrackerSessionTest, AnOrderToATrackerThatIsNotConnectedIsRefused) {
  on(TrackerOrder{TrackerOrder::What::GoHome, 1, "", 0.0});
  const auto report = session_.take_report();
  ASSERT_TRUE(report);
  EXPECT_FALSE(report->done());
  EXPECT_THAT(report->text, HasSubstr("disconnected"));
}

TEST_F(TrackerSessionTest, AnOrderUnderWayEndsWithTheConnection) {
  reach_streaming();
  on(TrackerOrder{TrackerOrder::What::GoHome, 1, "", 0.0});
  on(TrackerConnectionLost{"cable out"});
  const auto report = session_.take_report();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->outcome, TrackerOrderReport::Outcome::Failed);
}

// --- reflectors

emscon::Answer reflector(std::int32_t id, std::u16string_view name) {
  emscon::ReflectorsAnswer a;
  a.total = 2;
  a.internal_id = id;
  std::copy(name.begin(), name.end(), a.name.begin());
  return a;
}

class NamedReflector : public TrackerSessionTest {
 protected:
  NamedReflector() : TrackerSessionTest(named_reflector()) {}
  static TrackerSessionOptions named_reflector() {
    TrackerSessionOptions o;
    o.reflector = "Größe 1.5\"";
    return o;
  }
  void reach_list(std::int32_t in_use) {
    connect();
    pass_query(TrackerProcessorStatus::Initialised);
    answer_until(Command::GetReflector);
    on(emscon::Answer{emscon::ReflectorAnswer{Status::Ok, in_use}});
    ASSERT_EQ(sent_.back(), Command::GetReflectors);
    on(reflector(3, u"SMR 0.5\""));
    ASSERT_TRUE(nothing());
  }
};

TEST_F(NamedReflector, IsSetByItsId) {
  reach_list(3);
  on(reflector(5, u"Gr\u00f6\u00dfe 1.5\""));
  const auto* set = std::get_if<emscon::SetReflector>(&std::get<TrackerSend>(action_).request);
  ASSERT_NE(set, nullptr);
  EXPECT_EQ(set->internal_id, 5);
}

TEST_F(NamedReflector, ThatIsSetAlreadyIsNotSetAgain) {
  reach_list(5);
  on(reflector(5, u"Gr\u00f6\u00dfe 1.5\""));
  EXPECT_EQ(sent_.back(), Command::SetCoordinateSystemType);
}

TEST_F(NamedReflector, ThatIsUnknownIsAFaultThatNamesTheKnownOnes) {
  reach_list(3);
  on(reflector(4, u"Cat eye"));
  EXPECT_TRUE(closed());
  EXPECT_THAT(session_.fault().text, HasSubstr("is not in the controller's list"));
  EXPECT_THAT(session_.fault().text, HasSubstr("\"SMR 0.5\"\" (3), \"Cat eye\" (4)"));
}

TEST_F(TrackerSessionTest, ANameWithTerminalControlCharactersIsShownWithQuestionMarks) {
  reach_streaming();
  on(TrackerOrder{TrackerOrder::What::ListReflectors, 3, "", 0.0});
  on(emscon::Answer{emscon::ReflectorAnswer{Status::Ok, 4}});
  on(reflector(3, u"\x1b[2JSMR\x9b"));
  on(reflector(4, u"Cat eye"));
  const auto report = session_.take_report();
  ASSERT_TRUE(report && report->done());
  EXPECT_EQ(report->reflectors[0].name, "?[2JSMR?");
}

TEST_F(TrackerSessionTest, AListWithoutEndIsTruncated) {
  reach_streaming();
  on(TrackerOrder{TrackerOrder::What::ListReflectors, 3, "", 0.0});
  on(emscon::Answer{emscon::ReflectorAnswer{Status::Ok, 4}});
  emscon::ReflectorsAnswer one;
  one.total = std::numeric_limits<std::int32_t>::max();
  for (int i = 0; i < 1000; ++i) on(emscon::Answer{one});
  const auto report = session_.take_report();
  ASSERT_TRUE(report && report->done());
  EXPECT_EQ(report->reflectors.size(), 256u);
}

TEST_F(TrackerSessionTest, ABeamThatIsBackIsMeasuredAfterAListToo) {
  reach_streaming();
  say(Event::MeasurementNotReady);
  say(Event::MeasurementReady);
  on(TrackerOrder{TrackerOrder::What::ListReflectors, 3, "", 0.0});
  on(emscon::Answer{emscon::ReflectorAnswer{Status::Ok, 4}});
  on(reflector(3, u"SMR"));
  on(reflector(4, u"Cat eye"));
  let_pass(options_.resume_within);
  EXPECT_EQ(sent_.back(), Command::StartMeasurement);
}

TEST_F(TrackerSessionTest, ALossOfTheBeamDuringAListIsNoFault) {
  reach_streaming();
  on(TrackerOrder{TrackerOrder::What::ListReflectors, 3, "", 0.0});
  say(Event::MeasurementNotReady);
  on(emscon::Answer{emscon::ReflectorAnswer{Status::Ok, 5}});
  on(emscon::Answer{emscon::ReflectorsAnswer{.total = 1, .internal_id = 5}});

  EXPECT_EQ(session_.state(), TrackerState::BeamLost);
  let_pass(options_.keep_alive);
  EXPECT_EQ(sent_.back(), Command::GetTrackerStatus);
  EXPECT_EQ(session_.fault().count, 0u);
}

class StationaryOrders : public TrackerSessionTest {
 protected:
  StationaryOrders() : TrackerSessionTest(TrackerSessionOptions{.mode = TrackerMode::Stationary}) {}
};

TEST_F(StationaryOrders, AResultThatComesDuringAListIsFollowedByTheNextMeasurement) {
  connect();
  pass_query();
  answer_until(Command::StartMeasurement);
  answer();
  on(TrackerOrder{TrackerOrder::What::ListReflectors, 3, "", 0.0});
  on(emscon::Answer{emscon::ReflectorAnswer{Status::Ok, 4}});
  on(TrackerPointsArrived{1});
  on(reflector(3, u"SMR"));
  on(reflector(4, u"Cat eye"));
  ASSERT_TRUE(session_.take_report());
  EXPECT_EQ(sent_.back(), Command::StartMeasurement);
}

TEST_F(TrackerSessionTest, ListsReflectorsWhilePointsCome) {
  reach_streaming();
  on(TrackerOrder{TrackerOrder::What::ListReflectors, 3, "", 0.0});
  EXPECT_EQ(session_.state(), TrackerState::Streaming);
  on(emscon::Answer{emscon::ReflectorAnswer{Status::Ok, 4}});
  on(reflector(3, u"SMR"));
  on(reflector(4, u"Cat eye"));
  const auto report = session_.take_report();
  ASSERT_TRUE(report && report->done());
  ASSERT_EQ(report->reflectors.size(), 2u);
  EXPECT_EQ(report->reflectors[1].name, "Cat eye");
  EXPECT_TRUE(report->reflectors[1].in_use);
  EXPECT_EQ(session_.state(), TrackerState::Streaming);
}

}  // namespace
}  // namespace abbe::drivers

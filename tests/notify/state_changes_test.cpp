#include "abbe/notify/state_changes.hpp"

#include <gmock/gmock.h>

#include "status_example.hpp"

namespace abbe::notify {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

struct StateChangesTest : ::testing::Test {
  std::vector<Event> take(const json& status, std::chrono::milliseconds later = 1s) {
    return look(status, later);
  }
  std::vector<Event> away(std::chrono::milliseconds later = 1s) {
    return look(daemon::fail(daemon::ErrorCode::Io, "is abbed running?"), later);
  }
  /// The first answers of an abbed, until its devices have had time to connect.
  void settle(const json& status) {
    EXPECT_THAT(take(status), IsEmpty());
    EXPECT_THAT(take(status, 10s), IsEmpty());
  }
  static json with_session(const json& session) {
    json status = test::status();
    status["session"].update(session);
    return status;
  }
  static json with_tracker_lost() {
    json status = test::status();
    status["streams"][0] = test::stream("tracker", "connecting", false, "no reply in 200 ms");
    return status;
  }

 private:
  std::vector<Event> look(const daemon::DaemonPoll::Answer& answer,
                          std::chrono::milliseconds later) {
    now_.steady += later;
    now_.utc += later;
    return changes_.take(answer, now_);
  }

  StateChanges changes_{10s};
  Moment now_{};
};

TEST_F(StateChangesTest, SendNothingOfAGoodMachine) {
  settle(test::status());
  EXPECT_THAT(take(test::status()), IsEmpty());
}

TEST_F(StateChangesTest, SendAnExistingAlarmOnceAfterTheDevicesHadTime) {
  EXPECT_THAT(take(with_tracker_lost()), IsEmpty());
  EXPECT_THAT(take(with_tracker_lost(), 9s), IsEmpty());
  const auto events = take(with_tracker_lost());
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_EQ(events[0].kind, NotifyKind::DeviceLost);
  EXPECT_EQ(events[0].phase, Phase::Begins);
  EXPECT_EQ(events[0].severity, Severity::Fault);
  EXPECT_EQ(events[0].text, "tracker: connecting; last fault: no reply in 200 ms");
  EXPECT_THAT(take(with_tracker_lost()), IsEmpty());
}

TEST_F(StateChangesTest, ReportTheEndOfAnAlarm) {
  settle(test::status());
  EXPECT_THAT(take(with_tracker_lost()), SizeIs(1));
  const auto events = take(test::status());
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_EQ(events[0].phase, Phase::Ends);
  EXPECT_EQ(events[0].severity, Severity::Info);
  EXPECT_EQ(events[0].text, "tracker: streaming");
}

TEST_F(StateChangesTest, ReportAStarvedStreamOnceWhateverItsText) {
  settle(test::status());
  json status = test::status();
  status["streams"][0]["condition"] = "gives 61 % of its samples";
  ASSERT_THAT(take(status), SizeIs(1));
  status["streams"][0]["condition"] = "gives 58 % of its samples";
  EXPECT_THAT(take(status), IsEmpty());
}

TEST_F(StateChangesTest, ReportAVerdictOnce) {
  settle(test::status());
  const json running = with_session({{"id", 4}, {"state", "acquiring"}, {"reason", "1 of 3"}});
  EXPECT_THAT(take(running), IsEmpty());
  const json refused = with_session({{"id", 4},
                                     {"state", "refused"},
                                     {"reason", "refused: the tracker moved"},
                                     {"code", "refused"},
                                     {"model_id", "0123456789abcdef"}});
  const auto events = take(refused);
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_EQ(events[0].kind, NotifyKind::CalibrationRefused);
  EXPECT_EQ(events[0].text, "Calibration refused: the tracker moved");
  EXPECT_EQ(events[0].session, 4u);
  EXPECT_EQ(events[0].model_id, "0123456789abcdef");
  EXPECT_THAT(take(refused), IsEmpty());
}

TEST_F(StateChangesTest, DoNotSendTheVerdictThatIsThereAtTheStart) {
  settle(with_session({{"id", 4}, {"state", "refused"}, {"reason", "x"}, {"code", "refused"}}));
}

TEST_F(StateChangesTest, FindAVerdictThatTheNextCalibrationHasReplaced) {
  settle(test::status());
  json status = with_session({{"id", 5}, {"state", "warming"}, {"reason", "waiting"}});
  status["ended_sessions"] = {
      {{"id", 4}, {"state", "active"}, {"method", "otf"}, {"reason", "accepted: 0.1 um"}}};
  const auto events = take(status);
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_EQ(events[0].kind, NotifyKind::CalibrationAccepted);
  EXPECT_EQ(events[0].session, 4u);
}

TEST_F(StateChangesTest, DoNotReportWhatAPersonCancelled) {
  settle(test::status());
  EXPECT_THAT(
      take(with_session(
          {{"id", 4}, {"state", "refused"}, {"reason", "cancelled by anna"}, {"code", "refused"}})),
      IsEmpty());
}

TEST_F(StateChangesTest, AreNotSentTwiceAfterAbbedDidNotAnswer) {
  settle(test::status());
  EXPECT_THAT(take(with_tracker_lost()), SizeIs(1));
  EXPECT_THAT(away(), IsEmpty());
  EXPECT_THAT(take(with_tracker_lost()), IsEmpty());
}

TEST_F(StateChangesTest, FindAVerdictOfTheTimeWithoutAnswers) {
  settle(test::status());
  EXPECT_THAT(away(), IsEmpty());
  EXPECT_THAT(take(with_session({{"id", 4}, {"state", "active"}, {"reason", "accepted"}})),
              SizeIs(1));
}

TEST_F(StateChangesTest, ReportThatAbbedIsNotReachableAndThatItAnswers) {
  settle(test::status());
  EXPECT_THAT(away(), IsEmpty());
  EXPECT_THAT(away(9s), IsEmpty());
  const auto begins = away();
  ASSERT_THAT(begins, SizeIs(1));
  EXPECT_EQ(begins[0].kind, NotifyKind::NotReachable);
  EXPECT_EQ(begins[0].severity, Severity::Fault);
  EXPECT_EQ(begins[0].text, "is abbed running?");
  EXPECT_THAT(away(), IsEmpty());

  const auto ends = take(test::status());
  ASSERT_THAT(ends, SizeIs(1));
  EXPECT_EQ(ends[0].phase, Phase::Ends);
  EXPECT_EQ(ends[0].text, "abbed answers");
}

TEST_F(StateChangesTest, ReportARestartOnceAndNoAlarmAgain) {
  settle(test::status());
  EXPECT_THAT(take(with_tracker_lost()), SizeIs(1));
  EXPECT_THAT(away(), IsEmpty());
  json restarted = with_tracker_lost();
  restarted["process"] = 4712;
  restarted["session"]["id"] = 0;
  restarted["session"]["state"] = "idle";
  const auto events = take(restarted);
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_EQ(events[0].text, "abbed restarted");
  EXPECT_THAT(take(restarted, 20s), IsEmpty());
}

TEST_F(StateChangesTest, ReportAModelThatIsNotValidAfterARestartOnlyIfItStays) {
  settle(test::status());
  json status = test::status();
  status["process"] = 4712;
  status["session"] = {{"id", 0}, {"state", "idle"}, {"reason", ""}};
  status["model"]["state"] = "STALE";
  status["model"]["reason"] = "no axis positions yet";
  EXPECT_THAT(take(status), SizeIs(1)) << "the restart";
  status["model"]["state"] = "ACTIVE";
  EXPECT_THAT(take(status, 20s), IsEmpty());
}

TEST_F(StateChangesTest, TellDriftFromAModelThatIsNotValid) {
  settle(test::status());
  json status = test::status();
  status["model"]["state"] = "DRIFT";
  status["model"]["reason"] = "EXX changed";
  auto events = take(status);
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_EQ(events[0].kind, NotifyKind::Drift);
  EXPECT_EQ(events[0].text, "model 446300b9739c2c1a: DRIFT: EXX changed");

  status["model"]["state"] = "INVALID";
  events = take(status);
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_EQ(events[0].kind, NotifyKind::ModelNotValid);
  EXPECT_EQ(events[0].severity, Severity::Fault);
  EXPECT_EQ(events[0].model_id, "446300b9739c2c1a");
}

TEST_F(StateChangesTest, HaveNothingToReportOfAMachineWithoutAModel) {
  json status = test::status();
  status["model"] = {{"state", "NONE"}, {"reason", "no model has been activated"}};
  settle(status);
}

TEST_F(StateChangesTest, ReportAModelThatIsGone) {
  settle(test::status());
  json status = test::status();
  status["model"] = {{"state", "NONE"}, {"reason", "no model has been activated"}};
  EXPECT_THAT(take(status), SizeIs(1));
}

TEST_F(StateChangesTest, AskForAPersonAtEachPositionOfAnArray) {
  settle(test::status());
  const auto at = [](int position, const char* ball) {
    return with_session({{"id", 4},
                         {"state", "acquiring"},
                         {"reason", std::string("position ") + std::to_string(position) +
                                        " (1 of 8): touch " + ball + ", 25 points"},
                         {"next", {{"position", position}, {"on", ball}}}});
  };
  ASSERT_THAT(take(at(4, "ball 1")), SizeIs(1));
  EXPECT_THAT(take(at(4, "block 1")), IsEmpty());
  const auto events = take(at(8, "ball 1"));
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_EQ(events[0].kind, NotifyKind::PersonNeeded);
  EXPECT_EQ(events[0].text, "position 8 (1 of 8): touch ball 1, 25 points");
}

TEST_F(StateChangesTest, ReportReadyAndAMissedStart) {
  settle(test::status());
  const auto start = [](bool ready, bool missed, const char* reason) {
    return with_session({{"id", 4},
                         {"state", "warming"},
                         {"reason", reason},
                         {"start", {{"ready", ready}, {"missed", missed}}}});
  };
  EXPECT_THAT(take(start(false, false, "waiting for the tracker")), IsEmpty());
  const auto ready = take(start(true, false, "READY"));
  ASSERT_THAT(ready, SizeIs(1));
  EXPECT_EQ(ready[0].text, "READY: drive the path now");

  const auto missed = take(start(false, true, "start missed: the machine has left"));
  ASSERT_THAT(missed, SizeIs(1));
  EXPECT_EQ(missed[0].kind, NotifyKind::StartMissed);
  EXPECT_EQ(missed[0].severity, Severity::Warning);
}

TEST_F(StateChangesTest, ReportAMachineThatWaitsForItsRelease) {
  settle(test::status());
  json status = test::status();
  status["release_awaited"] = {{"reason", "stopped by AbortE"},
                               {"command", "abbe machine release"}};
  const auto events = take(status);
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_EQ(events[0].kind, NotifyKind::PersonNeeded);
  EXPECT_THAT(events[0].text, HasSubstr("abbe machine release"));
  EXPECT_THAT(take(status), IsEmpty());
}

TEST_F(StateChangesTest, ReportARecorderThatFails) {
  settle(test::status());
  json status = test::status();
  status["streams"][2] = test::stream("recorder", "stopped", false, "no space left");
  const auto events = take(status);
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_EQ(events[0].kind, NotifyKind::StorageFailed);
}

TEST_F(StateChangesTest, StateThatDevicesAreSimulated) {
  json status = with_tracker_lost();
  status["simulated"] = true;
  EXPECT_THAT(take(status), IsEmpty());
  EXPECT_THAT(take(status, 10s), ElementsAre(::testing::Field(&Event::simulated, true)));
}

TEST_F(StateChangesTest, TakeAnAnswerOfAnotherVersionForNone) {
  EXPECT_THAT(take(json{{"ok", true}}), IsEmpty());
  const auto events = take(json{{"ok", true}}, 10s);
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_THAT(events[0].text, HasSubstr("the answer of abbed is not that of this version"));
}

}  // namespace
}  // namespace abbe::notify

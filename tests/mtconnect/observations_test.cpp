#include "abbe/mtconnect/observations.hpp"

#include <gmock/gmock.h>

#include "status_example.hpp"

namespace abbe::mtconnect {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Key;
using ::testing::UnorderedElementsAre;

std::string event(const Observations& observed, const std::string& name) {
  return std::get<std::optional<std::string>>(observed.at(name)).value_or("UNAVAILABLE");
}

Condition condition(const Observations& observed, const std::string& name) {
  return std::get<std::optional<Condition>>(observed.at(name)).value();
}

TEST(Observations, OfAGoodMachineHaveNoCondition) {
  const auto observed = observations_of(test::status());
  for (const char* name : {"devices", "system", "calibration"})
    EXPECT_THAT(condition(observed, name), IsEmpty()) << name;
  EXPECT_EQ(event(observed, "avail"), "AVAILABLE");
  EXPECT_EQ(event(observed, "process_state"), "COMPLETE");
  EXPECT_EQ(event(observed, "process_id"), "3");
}

TEST(Observations, StateTheModel) {
  const auto status = test::status();
  const auto observed = observations_of(status);
  EXPECT_EQ(event(observed, "model_state"), "ACTIVE");
  EXPECT_EQ(event(observed, "model_id"), status["model"]["id"]);
  EXPECT_EQ(event(observed, "model_hash"), status["model"]["hash"]);
  EXPECT_EQ(event(observed, "model_date"), status["model"]["created"]);
}

TEST(Observations, StateWhetherDevicesOrModelAreSimulated) {
  auto status = test::status();
  status.erase("simulated");
  EXPECT_EQ(event(observations_of(status), "simulated"), "UNAVAILABLE") << "an older abbed";
  status["simulated"] = false;
  EXPECT_EQ(event(observations_of(status), "simulated"), "NO");
  status["model"]["simulated"] = true;
  EXPECT_EQ(event(observations_of(status), "simulated"), "YES");
  status["model"]["simulated"] = false;
  status["simulated"] = true;
  EXPECT_EQ(event(observations_of(status), "simulated"), "YES");
}

/// U with k = 2 in um; the data item is the standard uncertainty in mm.
TEST(Observations, StateTheStandardUncertaintyInMillimetres) {
  const auto observed = observations_of(test::status());
  EXPECT_DOUBLE_EQ(std::stod(event(observed, "u_volume")),
                   test::status()["model"]["largest_U_um"].get<double>() / 2.0 * 1e-3);
  EXPECT_EQ(event(observed, "u_type"), "COMBINED");
}

TEST(Observations, WithoutAModelAreUnavailable) {
  auto status = test::status();
  status["model"] = {{"state", "NONE"}, {"reason", "no model has been activated"}};
  const auto observed = observations_of(status);
  for (const char* name : {"model_id", "model_hash", "model_date", "u_volume", "u_type"})
    EXPECT_EQ(event(observed, name), "UNAVAILABLE") << name;
  EXPECT_THAT(condition(observed, "calibration"), ElementsAre(Key("MODEL_NONE")));
}

TEST(Observations, RaiseAConditionForEachDevice) {
  auto status = test::status();
  status["streams"][0] = test::stream("tracker", "connecting", false, "no reply in 200 ms");
  status["streams"][1] = test::stream("encoder", "reading", true, "", "X missing (node 1)");
  const auto devices = condition(observations_of(status), "devices");
  EXPECT_EQ(devices.at("tracker").level, Level::Fault);
  EXPECT_EQ(devices.at("tracker").text, "connecting; last fault: no reply in 200 ms");
  EXPECT_EQ(devices.at("encoder").level, Level::Warning);
  EXPECT_EQ(devices.at("encoder").text, "X missing (node 1)");
}

TEST(Observations, SeparateDevicesFromPartsOfTheDaemon) {
  auto status = test::status();
  status["streams"].push_back(test::stream("identity", "not confirmed", true));
  for (auto& stream : status["streams"]) stream["connected"] = false;
  const auto observed = observations_of(status);
  EXPECT_THAT(condition(observed, "devices"), UnorderedElementsAre(Key("tracker"), Key("encoder")));
  const auto system = condition(observed, "system");
  EXPECT_EQ(system.at("recorder").level, Level::Fault);
  EXPECT_EQ(system.at("dds_security").level, Level::Warning);
  EXPECT_TRUE(system.contains("identity"));
}

TEST(Observations, RaiseAConditionForEachVerdict) {
  auto status = test::status();
  status["session"] = {{"id", 4},
                       {"state", "refused"},
                       {"method", "otf"},
                       {"code", "data_insufficient"},
                       {"reason", "the path has 3 legs, needed are 20"}};
  const auto observed = observations_of(status);
  const auto raised = condition(observed, "calibration").at("REFUSED_DATA_INSUFFICIENT");
  EXPECT_EQ(raised.level, Level::Warning);
  EXPECT_EQ(raised.text, status["session"]["reason"]);
  EXPECT_EQ(event(observed, "process_state"), "ABORTED");
}

TEST(Observations, RaiseAFaultForAModelThatMustNotBeUsed) {
  auto status = test::status();
  for (const std::string state : {"STALE", "DRIFT", "INVALID"}) {
    status["model"]["state"] = state;
    const auto raised = condition(observations_of(status), "calibration").at("MODEL_" + state);
    EXPECT_EQ(raised.level, state == "INVALID" ? Level::Fault : Level::Warning) << state;
  }
}

TEST(Observations, WarnOfARecordingThatIsBehindTheMachine) {
  auto status = test::status();
  status["streams"][2]["condition"] = "the file is more than 5 s behind the machine";
  const auto raised = condition(observations_of(status), "system").at("recorder");
  EXPECT_EQ(raised.level, Level::Warning);
  EXPECT_EQ(raised.text, "the file is more than 5 s behind the machine");
}

TEST(Observations, WarnOfAModelThatAPersonActivatedAgainstTheGate) {
  auto status = test::status();
  EXPECT_FALSE(condition(observations_of(status), "calibration").contains("MODEL_REFUSED"));
  status["model"]["reason"] = "forced by anna: crane test; the gate had refused it: 3 mm";
  status["model"]["refused"] = "3 mm";
  const auto raised = condition(observations_of(status), "calibration").at("MODEL_REFUSED");
  EXPECT_EQ(raised.level, Level::Warning);
  EXPECT_EQ(raised.text, status["model"]["reason"]);
}

TEST(Observations, WarnOfAClockThatWasSet) {
  auto status = test::status();
  status["clock"] = {"the wall clock was set forward by 200 d 0 h"};
  const auto raised = condition(observations_of(status), "system").at("CLOCK");
  EXPECT_EQ(raised.level, Level::Warning);
  EXPECT_THAT(raised.text, HasSubstr("200 d"));
}

TEST(Observations, AskForTheReleaseOfAMachine) {
  auto status = test::status();
  status["release_awaited"] = {{"reason", "collision"}, {"command", "abbe machine release"}};
  const auto raised = condition(observations_of(status), "system").at("release");
  EXPECT_EQ(raised.level, Level::Fault);
  EXPECT_THAT(raised.text, HasSubstr("abbe machine release"));
}

TEST(Observations, OfAnUnknownAnswerAreRefused) {
  EXPECT_ANY_THROW((void)observations_of({{"ok", true}}));
  auto status = test::status();
  status["session"]["state"] = "dreaming";
  EXPECT_ANY_THROW((void)observations_of(status));
  status = test::status();
  status["streams"][0]["connected"] = "yes";
  EXPECT_ANY_THROW((void)observations_of(status));
}

TEST(Observations, OfADaemonThatIsAwayNameTheSameDataItems) {
  std::vector<std::string> present, away;
  for (const auto& [name, value] : observations_of(test::status())) present.push_back(name);
  for (const auto& [name, value] : nothing_observed()) away.push_back(name);
  EXPECT_EQ(present, away);
}

}  // namespace
}  // namespace abbe::mtconnect

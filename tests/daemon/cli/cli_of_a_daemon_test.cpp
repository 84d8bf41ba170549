/// `abbe` where it asks a running daemon and waits for what comes of it.

#include <gmock/gmock.h>
#include <signal.h>

#include <atomic>
#include <functional>
#include <nlohmann/json.hpp>

#include "abbe/base/control_protocol.hpp"
#include "abbe_command.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using test::text_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// A daemon that goes through the given states, one per request; `at_question` is called with the
/// number of requests so far.
struct ScriptedDaemon {
  std::vector<nlohmann::json> sessions;
  std::function<void(std::size_t)> at_question = [](std::size_t) {};
  std::size_t asked = 0;

  nlohmann::json operator()(const nlohmann::json& request, const ControlPeer&) {
    if (request["do"] != "status") return {{"ok", true}};
    at_question(asked);
    const auto& session = sessions[std::min(asked++, sessions.size() - 1)];
    return {{"ok", true}, {"session", session}};
  }
};

nlohmann::json session(const std::string& state, const std::string& reason) {
  return {{"state", state},
          {"reason", reason},
          {"progress", 0.5},
          {"model_id", state == "active" ? "abcd" : ""}};
}

class CliOfADaemon : public ::testing::Test {
 protected:
  CliOfADaemon() { test::write_text(path_, "x_mm,y_mm,z_mm\n0,0,0\n100,0,0\n"); }
  [[nodiscard]] test::Ran calibrate(const fs::path& socket) const {
    return test::run_abbe(folder_.path(), fmt::format("calibrate otf --path '{}' --socket '{}'",
                                                      path_.string(), socket.string()));
  }

  TemporaryFolder folder_;
  fs::path path_ = folder_.path() / "path.csv";
};

TEST_F(CliOfADaemon, CalibratePrintsWhatEveryStepWaitsFor) {
  const auto socket = folder_.path() / "told.sock";
  const auto daemon = ControlServer::open(
      socket,
      ScriptedDaemon{
          {session("warming", "waiting for the machine to stand at (1.000, 2.000, 3.000) mm"),
           session("acquiring", "driving the path"), session("active", "accepted")}});
  ASSERT_TRUE(daemon);
  const auto ran = calibrate(socket);
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.err, AllOf(HasSubstr("start: waiting for the machine to stand at (1.000"),
                             HasSubstr("acquiring: driving the path")));
  EXPECT_THAT(ran.out, StartsWith("calibration has ended: accepted, model abcd\n  accepted\n"));
}

nlohmann::json acquiring_with(const std::vector<nlohmann::json>& tables) {
  auto acquiring = session("acquiring", "driving the path");
  acquiring["remaining_s"] = 200.0;
  acquiring["live"] = {{"tables", tables}, {"samples", 1000}, {"variance_factor", 1.0}};
  return acquiring;
}

TEST_F(CliOfADaemon, CalibratePrintsHowManyTablesTheRunDetermines) {
  const auto table = [](const char* unit, const nlohmann::json& u) {
    return nlohmann::json{{"unit", unit}, {"determined", u[0].is_number()}, {"u", u}};
  };
  const nlohmann::json none{nullptr, 0.5e-6};
  const auto socket = folder_.path() / "tables.sock";
  const auto daemon = ControlServer::open(
      socket,
      ScriptedDaemon{{acquiring_with({table("m", none), table("rad", none)}),
                      acquiring_with({table("m", {0.4e-6, 0.8e-6}), table("rad", none)}),
                      acquiring_with({table("m", {0.4e-6, 0.7e-6}), table("rad", none)}),
                      acquiring_with({table("m", {0.3e-6, 0.6e-6}), table("rad", {1.5e-6, 1e-6})}),
                      acquiring_with({table("m", {0.1e-6, 0.2e-6}), table("rad", {1.2e-6, 1e-6})}),
                      session("active", "accepted")}});
  ASSERT_TRUE(daemon);
  const auto ran = calibrate(socket);
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_EQ(ran.err,
            "acquiring: driving the path\n"
            "tables: 1 of 2 determined, largest u 0.80 um\n"
            "tables: 2 of 2 determined, largest u 0.60 um, 1.50 urad\n"
            "tables: 2 of 2 determined, largest u 0.20 um, 1.20 urad\n");
}

TEST_F(CliOfADaemon, CalibratePrintsUncertaintiesOfDeterminedTablesOnly) {
  const nlohmann::json rotation{{"unit", "rad"}, {"determined", true}, {"u", {1.5e-6, 0.0}}};
  const nlohmann::json open{{"unit", "m"}, {"determined", false}, {"u", {0.5e-6, nullptr}}};
  const auto socket = folder_.path() / "units.sock";
  const auto daemon = ControlServer::open(
      socket, ScriptedDaemon{{acquiring_with({open, open}), acquiring_with({rotation, open}),
                              session("active", "accepted")}});
  ASSERT_TRUE(daemon);
  EXPECT_EQ(calibrate(socket).err,
            "acquiring: driving the path\n"
            "tables: 1 of 2 determined, largest u 1.50 urad\n");
}

nlohmann::json refused_as(const std::string& code) {
  auto refused = session("refused", "because");
  refused["code"] = code;
  return refused;
}

TEST_F(CliOfADaemon, CalibrateExitsWithTheCodeOfTheRefusal) {
  const std::vector<std::pair<std::string, int>> codes{
      {"data_insufficient", 1}, {"bad_input", 3}, {"io", 4}, {"refused", 5}};
  for (const auto& [code, exit] : codes) {
    const auto socket = folder_.path() / "code.sock";
    const auto daemon = ControlServer::open(socket, ScriptedDaemon{{refused_as(code)}});
    ASSERT_TRUE(daemon);
    const auto ran = calibrate(socket);
    EXPECT_EQ(ran.exit, exit) << code;
    EXPECT_THAT(ran.out, HasSubstr("because"));
  }
}

TEST_F(CliOfADaemon, ADaemonThatRestartedLosesTheSession) {
  const auto socket = folder_.path() / "lost.sock";
  const auto daemon = ControlServer::open(
      socket, ScriptedDaemon{{session("acquiring", "driving"), session("idle", "")}});
  ASSERT_TRUE(daemon);
  const auto ran = calibrate(socket);
  EXPECT_EQ(ran.exit, 4);
  EXPECT_THAT(ran.err, HasSubstr("lost"));
}

TEST_F(CliOfADaemon, CalibrateReportsTheVerdictOfItsOwnSessionOnly) {
  const auto socket = folder_.path() / "own.sock";
  const auto numbered = [](int id, const std::string& state) {
    auto one = session(state, "of session " + std::to_string(id));
    one["id"] = id;
    if (state == "refused") one["code"] = "data_insufficient";
    return one;
  };

  std::atomic<bool> kept = true;
  const auto daemon = ControlServer::open(
      socket, [&](const nlohmann::json& request, const ControlPeer&) -> nlohmann::json {
        if (request["do"] == "calibrate") return {{"ok", true}, {"session", 7}};
        return {{"ok", true},
                {"session", numbered(8, "active")},
                {"ended_sessions", {numbered(kept ? 7 : 6, "refused")}}};
      });

  ASSERT_TRUE(daemon);
  const auto refused = calibrate(socket);

  EXPECT_EQ(refused.exit, 1);
  EXPECT_THAT(refused.out, HasSubstr("of session 7"));
  kept = false;
  const auto lost = calibrate(socket);
  EXPECT_EQ(lost.exit, 4);
  EXPECT_THAT(lost.err, HasSubstr("calibration 7 has ended"));
}

TEST_F(CliOfADaemon, ReferencePrintsEachAxisInItsUnits) {
  const auto socket = folder_.path() / "reference.sock";
  const auto axis = [](const char* name, const char* kind) {
    return nlohmann::json{
        {"axis", name},  {"kind", kind}, {"state", "found"},          {"marks", 4},
        {"known", true}, {"u", 2e-6},    {"reading_at_zero", 0.0125}, {"reason", ""}};
  };

  const auto daemon =
      ControlServer::open(socket, [&](const nlohmann::json&, const ControlPeer&) -> nlohmann::json {
        return {{"ok", true},
                {"reference",
                 {{"running", false}, {"axes", {axis("X", "linear"), axis("C", "rotary")}}}}};
      });

  ASSERT_TRUE(daemon);
  const auto ran =
      test::run_abbe(folder_.path(), fmt::format("reference --socket '{}'", socket.string()));
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, AllOf(HasSubstr("at 12.500000 mm, u = 2.000 um"),
                             HasSubstr("at 0.012500000 rad, u = 2.000 urad")));
}

nlohmann::json status_with_positions() {
  return {{"ok", true},
          {"machine", "mill"},
          {"model", {{"state", "INVALID"}, {"reason", "no model is active"}}},
          {"session",
           {{"state", "idle"},
            {"progress", 0.0},
            {"points", 0},
            {"reason", ""},
            {"notes", nlohmann::json::array()}}},
          {"streams", nlohmann::json::array()},
          {"position_m", {0.01, nullptr, 0.5}},
          {"axes",
           {{{"axis", "X"}, {"kind", "linear"}},
            {{"axis", "Y"}, {"kind", "linear"}},
            {{"axis", "C"}, {"kind", "rotary"}}}}};
}

TEST_F(CliOfADaemon, StatusShowsThePositionsOfTheAxes) {
  const auto socket = folder_.path() / "positions.sock";
  const auto daemon = ControlServer::open(
      socket, [](const nlohmann::json&, const ControlPeer&) { return status_with_positions(); });
  ASSERT_TRUE(daemon);
  const auto ran =
      test::run_abbe(folder_.path(), fmt::format("status --socket '{}'", socket.string()));
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("position   X 10.0000 mm  Y -  C 28.6479 deg\n"));
}

TEST_F(CliOfADaemon, StatusShowsWhyAnAxisHasNoPositionAndHowFarTheRecordingIsBehind) {
  const auto socket = folder_.path() / "missing.sock";
  auto status = status_with_positions();
  status["axes"][1]["missing"] = "scale_y is not available (Y is missing): rtd sends no value";
  status["recording"] = "run.mcap.part";
  status["streams"] = {{{"name", "recorder"},
                        {"state", "recording"},
                        {"connected", true},
                        {"rate_hz", 0.0},
                        {"samples", 1},
                        {"dropped", 0},
                        {"gaps", 0},
                        {"last_fault", ""},
                        {"behind_s", 31.04}}};
  const auto daemon = ControlServer::open(
      socket, [&status](const nlohmann::json&, const ControlPeer&) { return status; });
  ASSERT_TRUE(daemon);
  const auto ran =
      test::run_abbe(folder_.path(), fmt::format("status --socket '{}'", socket.string()));
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out,
              HasSubstr("Y: scale_y is not available (Y is missing): rtd sends no value\n"));
  EXPECT_THAT(ran.out, HasSubstr("recording  run.mcap.part, 31.0 s behind\n"));
}

TEST_F(CliOfADaemon, AVerdictIsShownInOneLinePerSentence) {
  const nlohmann::json verdict{{"figures", "held-out residual rms 0.200 um"},
                               {"reasons", {"the steepest change is 9 um/m", "the noise is 4 um"}},
                               {"notes", {"1 K of steel would be 3 um rms"}}};
  const std::string sentences =
      "reason: the steepest change is 9 um/m\n{0}reason: the noise is 4 um\n"
      "{0}held-out residual rms 0.200 um\n{0}note: 1 K of steel would be 3 um rms\n";
  auto ended = session("refused", "refused: all in one line");
  ended["verdict"] = verdict;
  const auto socket = folder_.path() / "verdict.sock";
  const auto daemon = ControlServer::open(socket, ScriptedDaemon{{ended}});
  ASSERT_TRUE(daemon);
  const auto followed = calibrate(socket);
  EXPECT_NE(followed.exit, 0);
  EXPECT_THAT(followed.out, StartsWith("calibration has ended: refused\n  " +
                                       fmt::format(fmt::runtime(sentences), "  ")));

  auto status = status_with_positions();
  ended["points"] = 12;
  ended["notes"] = nlohmann::json::array();
  status["session"] = ended;
  const auto second = folder_.path() / "status.sock";
  const auto answering = ControlServer::open(
      second, [&status](const nlohmann::json&, const ControlPeer&) { return status; });
  ASSERT_TRUE(answering);
  const auto ran =
      test::run_abbe(folder_.path(), fmt::format("status --socket '{}'", second.string()));
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("session    has ended: refused, 50 %, 12 points\n           " +
                                 fmt::format(fmt::runtime(sentences), "           ")));
}

TEST_F(CliOfADaemon, StatusShowsTheRemainingTimeInSecondsOrMinutes) {
  const std::vector<std::pair<nlohmann::json, std::string>> cases{{380.0, "about 6.3 min left\n"},
                                                                  {59.7, "about 1.0 min left\n"},
                                                                  {44.8, "about 45 s left\n"},
                                                                  {-1.0, "about 0 s left\n"},
                                                                  {nullptr, "position"}};
  const auto socket = folder_.path() / "remaining.sock";
  for (const auto& [remaining_s, shown] : cases) {
    auto status = status_with_positions();
    status["session"]["remaining_s"] = remaining_s;
    const auto daemon = ControlServer::open(
        socket, [&status](const nlohmann::json&, const ControlPeer&) { return status; });
    ASSERT_TRUE(daemon);
    const auto ran =
        test::run_abbe(folder_.path(), fmt::format("status --socket '{}'", socket.string()));
    EXPECT_EQ(ran.exit, 0) << ran.err;
    EXPECT_THAT(ran.out, HasSubstr(shown));
  }
}

TEST_F(CliOfADaemon, ADaemonThatRestartedLosesTheReferenceSearch) {
  const auto socket = folder_.path() / "search.sock";
  std::atomic<int> asked = 0;
  const auto daemon =
      ControlServer::open(socket, [&](const nlohmann::json&, const ControlPeer&) -> nlohmann::json {
        return {{"ok", true},
                {"process", asked++ < 2 ? 1 : 2},
                {"reference", {{"running", true}, {"axes", nlohmann::json::array()}}}};
      });

  ASSERT_TRUE(daemon);
  const auto ran =
      test::run_abbe(folder_.path(), fmt::format("reference --socket '{}'", socket.string()));
  EXPECT_EQ(ran.exit, 4);
  EXPECT_THAT(ran.err, HasSubstr("search for the marks is lost"));
}

TEST_F(CliOfADaemon, CalibrateInterruptedSaysHowToCancel) {
  const auto socket = folder_.path() / "left.sock", pid_file = folder_.path() / "left.pid";
  ScriptedDaemon script{{session("acquiring", "driving the path")}};
  script.at_question = [&pid_file](std::size_t n) {
    if (n == 1) ::kill(std::stoi(text_of(pid_file)), SIGINT);
  };

  const auto daemon = ControlServer::open(socket, script);
  ASSERT_TRUE(daemon);
  const auto command = fmt::format(
      "sh -c 'echo $$ >{}; exec {} calibrate otf --path {} --socket {}' 2>{}", pid_file.string(),
      ABBE_PROGRAM, path_.string(), socket.string(), (folder_.path() / "left.err").string());
  const int status = std::system(command.c_str());
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 130);
  EXPECT_THAT(text_of(folder_.path() / "left.err"),
              HasSubstr("--cancel --socket " + socket.string()));
}

}  // namespace
}  // namespace abbe::daemon

/// A Multi-Feature Bar from the first touch on the wire to the model and its replays, touches that
/// are wrong, and a session that is interrupted.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>

#include <filesystem>

#include "bar_run.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

struct BarSession : BarRun {
  void start_both(const std::vector<std::string>& more = {}) {
    ASSERT_NO_FATAL_FAILURE(start_bar_simulator(more));
    write_bar_configuration();
    ASSERT_NO_FATAL_FAILURE(start_abbed());
  }

  [[nodiscard]] std::vector<std::string> calibrate(const std::vector<std::string>& more) const {
    std::vector<std::string> command{ABBE_PROGRAM, "calibrate", "mfb", "-c", file("abbed.toml")};
    command.insert(command.end(), more.begin(), more.end());
    return command;
  }
  [[nodiscard]] std::vector<std::string> of_files() const {
    return {"--bar", file("bar") + "/bar.toml", "--plan", file("bar") + "/plan.toml"};
  }
  [[nodiscard]] json session() const {
    const json now = status();
    return now.is_object() ? now["session"] : json();
  }
  /// To its end; the machine begins once the session waits for it.
  [[nodiscard]] Outcome calibrated(const std::vector<std::string>& more) const {
    Program calibration(calibrate(more), directory_ / "calibrate");
    EXPECT_TRUE(eventually([&] {
      const json now = session();
      return !calibration.running() || (now.is_object() && now["state"] == "warming");
    }));
    simulator_->signal(SIGUSR1);
    const int code = calibration.wait_for_end(kPatienceForARun);
    return {code, calibration.out(), calibration.err()};
  }

  void expect_the_same_again(const std::string& recording,
                             const std::vector<std::string>& options) const {
    std::vector<std::string> command{ABBE_PROGRAM, "replay", "--json", recording};
    command.insert(command.end(), options.begin(), options.end());
    const auto replayed = run(command);
    EXPECT_TRUE(replayed.code == 0 || replayed.code == 5) << replayed.err << replayed.out;
    const json said = json::parse(replayed.out, nullptr, false);
    ASSERT_TRUE(said.is_object()) << replayed.out;
    EXPECT_TRUE(said["same_as_live"]) << said.dump(1);
  }
  void expect_the_id_from(const std::string& recording, const json& live_id) const {
    const auto identified = run({ABBE_PROGRAM, "identify", "mfb", "--recording", recording,
                                 "--json", "-o", file("identified")});
    const json said = json::parse(identified.out, nullptr, false);
    ASSERT_TRUE(said.is_object()) << identified.out << identified.err;
    EXPECT_EQ(said["id"], live_id);
  }
  void expect_smaller_errors() const {
    const auto verified = run({ABBE_PROGRAM, "verify", "active", "-c", file("abbed.toml"),
                               "--points", file("bar") + "/verification.csv", "--json"});
    EXPECT_EQ(verified.code, 0) << verified.err;
    const json said = json::parse(verified.out, nullptr, false);
    ASSERT_TRUE(said.is_object()) << verified.out;
    EXPECT_LT(said["after"]["rms_um"], 2.0);
    EXPECT_GT(said["before"]["rms_um"], 20.0);
  }
};

TEST_F(BarSession, IsGuidedIdentifiedAndReplayedTheSame) {
  ASSERT_NO_FATAL_FAILURE(start_both({"--silent", "30", "--double", "200", "--stray", "400"}));
  const auto outcome = calibrated(of_files());
  ASSERT_EQ(outcome.code, 0) << outcome.out << outcome.err;
  EXPECT_THAT(session()["notes"].get<std::vector<std::string>>(),
              ElementsAre(HasSubstr("was not touched: touch it after the pass"),
                          HasSubstr("ends without 1 of 148 touches"),
                          HasSubstr("was touched twice; it counts once"),
                          HasSubstr("mm from the nearest place")));
  EXPECT_EQ(session()["points"], 12 * 148 - 1);
  const json model = status()["model"];
  EXPECT_EQ(model["state"], "ACTIVE");
  EXPECT_EQ(model["method"], "mfb");
  expect_smaller_errors();
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
  expect_the_same_again(recordings().front(), {});
  expect_the_same_again(recordings().front(), {"--raw"});
  expect_the_id_from(recordings().front(), model["id"]);
}

TEST_F(BarSession, ContinuesWhereItWasInterrupted) {
  ASSERT_NO_FATAL_FAILURE(start_both());
  auto detached = calibrate(of_files());
  detached.emplace_back("--detach");
  ASSERT_EQ(run(detached).code, 0);
  EXPECT_EQ(session()["next"]["on"], "hole 1");
  EXPECT_EQ(session()["next"]["measurement"], "X1");
  simulator_->signal(SIGUSR1);
  ASSERT_TRUE(eventually([this] { return session()["points"] > 200; })) << session().dump(1);
  EXPECT_EQ(run(calibrate({"--cancel"})).code, 0);
  const auto taken = session()["points"].get<std::size_t>();
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
  simulator_->stop();
  const std::string interrupted = recordings().front();

  // Another day: the machine goes on after the last touch that was taken.
  ASSERT_NO_FATAL_FAILURE(start_both({"--from", std::to_string(taken)}));
  const auto outcome = calibrated({"--continue", interrupted});
  EXPECT_THAT(outcome.err, HasSubstr(" touches of "));
  EXPECT_EQ(session()["points"], 12 * 148) << outcome.err;
  // Touches on their way at the instant of the cancellation are in the recording: they are made
  // again.
  EXPECT_LE(session()["noted"], 12) << session().dump(1);
  ASSERT_EQ(outcome.code, 0) << outcome.out << outcome.err;
  const json model = status()["model"];
  EXPECT_EQ(model["state"], "ACTIVE");
  expect_smaller_errors();
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
  expect_the_same_again(recordings().back(), {"--raw"});
  expect_the_id_from(recordings().back(), model["id"]);
}

TEST_F(BarSession, ARequestThatCannotGiveAModelIsRefusedBeforeTheFirstTouch) {
  ASSERT_NO_FATAL_FAILURE(start_both());
  const std::string plan = text_of(file("bar") + "/plan.toml");
  const auto refused = [&](const std::string& text, int code, const std::string& why) {
    write("wrong.toml", text);
    const auto outcome =
        run(calibrate({"--bar", file("bar") + "/bar.toml", "--plan", file("wrong.toml")}));
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(why));
  };
  refused(plan.substr(0, plan.find("[[measurement]]", plan.find("name = \"Y1\""))), 3,
          "the measurements do not show");
  refused(replaced(plan, "origin_mm = \\[0, 100, 0\\]", "origin_mm = [90, 100, 0]"), 3, "X1");
  refused("[plan]\n", 3, "wrong.toml");
  EXPECT_EQ(run(calibrate({})).code, 2);
  EXPECT_EQ(run(calibrate({"--continue", file("machine.toml")})).code, 3);
}

}  // namespace
}  // namespace abbe::test

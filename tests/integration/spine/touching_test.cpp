/// A ball array from the first touch on the wire to the compensation a subscriber receives, and
/// the messages when touches are wrong.

#include <gmock/gmock.h>

#include <sstream>

#include "touching_run.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;

struct WholeArray : TouchingRun {
  void start_everything() {
    warm_the_array();
    ASSERT_NO_FATAL_FAILURE(start_touching_simulator());
#ifdef ABBE_WITH_DDS
    write_touching_configuration(kAccepting, "child");

    ASSERT_NO_FATAL_FAILURE(start_abbed());
    watch_ =
        start({ABBE_WATCH_PROGRAM, "--domain", domain_.text(), "--profile", ABBE_LOOPBACK_PROFILE,
               "--json", "--compare", file("truth.csv"), "--timeout-s", "100"},
              "watch");
#else
    write_touching_configuration();
    ASSERT_NO_FATAL_FAILURE(start_abbed());
#endif
  }

#ifdef ABBE_WITH_DDS
  /// Lines of abbe-watch that hold `key`.
  std::vector<json> heard(const std::string& key) const {
    std::vector<json> all;
    std::istringstream lines{watch_->out()};
    for (std::string line; std::getline(lines, line);) {
      const json said = json::parse(line, nullptr, false);
      if (said.is_object() && said.contains(key)) all.push_back(said);
    }
    return all;
  }
#endif

  void expect_subscriber_sees_a_smaller_error() {
#ifdef ABBE_WITH_DDS
    EXPECT_EQ(watch_->wait_for_end(), 0) << watch_->err();
    const auto compared = heard("comparison");
    ASSERT_EQ(compared.size(), 1u);
    const json c = compared.front()["comparison"];
    EXPECT_GT(c["before_mean_um"], 1000.0);
    // Six touches of 3 um a ball leave some micrometres, the linear interpolation between the
    // grid's nodes tens; the blocks' direction, which the machine measured itself, is a rigid
    // motion.
    EXPECT_LT(c["after_rigid_free_mean_um"], 0.1 * c["before_mean_um"].get<double>());
#endif
  }

  void expect_the_same_again(const std::vector<std::string>& options) const {
    std::vector<std::string> command{ABBE_PROGRAM, "replay", "--json", recordings().front()};
    command.insert(command.end(), options.begin(), options.end());
    const auto replayed = run(command);
    EXPECT_EQ(replayed.code, 0) << replayed.err << replayed.out;
    const json said = json::parse(replayed.out, nullptr, false);
    ASSERT_TRUE(said.is_object()) << replayed.out;
    EXPECT_EQ(said["live_model_ids"].size(), 1u);
    EXPECT_TRUE(said["same_as_live"]) << said.dump(1);
  }

  void expect_the_array_is_warm_in(const json& identified) const {
    const json artefact = identified["artefact"];
    EXPECT_NEAR(artefact["temperature_C"].get<double>(), 23.4, 0.05) << identified.dump(1);
    EXPECT_GE(artefact["u_temperature_K"].get<double>(), 0.1);
    EXPECT_NEAR(artefact["expansion_factor"].get<double>() - 1.0, 3.4 * 11.5e-6, 1e-6);
    EXPECT_THAT(identified["gate"]["notes"].dump(), testing::Not(HasSubstr("20 C")));
  }

  void expect_the_live_model_from(const std::string& recording, const std::string& live_id) const {
    const auto identified = run({ABBE_PROGRAM, "identify", "evemu", "--recording", recording,
                                 "--json", "-o", file("identified")});
    EXPECT_EQ(identified.code, 0) << identified.err;
    const json said = json::parse(identified.out, nullptr, false);
    ASSERT_TRUE(said.is_object()) << identified.out;
    EXPECT_EQ(said["id"], live_id);
    EXPECT_TRUE(said["gate"]["accepted"]) << said.dump(1);
    expect_the_array_is_warm_in(said);
  }

  void expect_shape_only_without_acceptance() const {
    write_touching_configuration("max_error_mm = 10\nmax_gradient = 0.5\n");
    const auto judged =
        run({ABBE_PROGRAM, "replay", "--json", recordings().front(), "-c", file("abbed.toml")});
    const json said = json::parse(judged.out, nullptr, false);
    ASSERT_TRUE(said.is_object()) << judged.out << judged.err;
    EXPECT_FALSE(said["calibrations"].at(0)["accepted"]);
    EXPECT_THAT(said["calibrations"].at(0)["reasons"].dump(), HasSubstr("shape only"));
  }

  std::unique_ptr<Program> watch_;
};

TEST_F(WholeArray, IsGuidedIdentifiedPublishedAndReplayedTheSame) {
  ASSERT_NO_FATAL_FAILURE(start_everything());
  ASSERT_TRUE(eventually([this] { return samples("rtd") > 2; })) << status().dump(1);
  const auto calibrated = calibrate_touching();

  ASSERT_EQ(calibrated.code, 0) << calibrated.out << calibrated.err;
  EXPECT_EQ(session()["noted"], 0) << session().dump(1);
  EXPECT_EQ(session()["points"], 8 * (9 * 6 + 2 * 5));
  const json model = status()["model"];
  EXPECT_EQ(model["state"], "ACTIVE");
  EXPECT_EQ(model["method"], "evemu");
  ASSERT_NO_FATAL_FAILURE(expect_subscriber_sees_a_smaller_error());
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
  expect_the_same_again({});
  expect_the_same_again({"--raw"});
  expect_the_live_model_from(recordings().front(), model["id"]);
  expect_shape_only_without_acceptance();
}

TEST_F(TouchingRun, ReportsMissedDoubledAndMisplacedTouchesAndContinues) {
  // Ball 1 is touched by 0 to 5, block 1 by 6 to 10, block 2 by 11 to 15, ball 2 by 16 to 21, ball
  // 3 from 22.
  ASSERT_NO_FATAL_FAILURE(
      start_touching_simulator({"--double", "3", "--miss", "20", "--stray", "24"}));
  write_touching_configuration();

  ASSERT_NO_FATAL_FAILURE(start_abbed());
  auto command = calibrate_command("calibrator.toml");
  command.emplace_back("--detach");
  ASSERT_EQ(run(command).code, 0);
  EXPECT_EQ(session()["next"]["on"], "ball 1");
  EXPECT_EQ(session()["next"]["position"], 4);
  let_machine_go();
  ASSERT_TRUE(eventually([this] {
    return session().contains("next") && session()["next"]["on"] == "ball 5";
  })) << session().dump(1);
  const auto notes = session()["notes"].get<std::vector<std::string>>();
  EXPECT_THAT(notes, ElementsAre(HasSubstr("the same place on ball 1 was touched twice"),
                                 HasSubstr("ball 2 has 5 of 6 points, the rest was missed"),
                                 HasSubstr("is on no ball or block; nearest is ball 3")));
  EXPECT_THAT(notes.front(), HasSubstr("probe touch "));
  EXPECT_EQ(run({ABBE_PROGRAM, "calibrate", "evemu", "-c", file("abbed.toml"), "--cancel"}).code,
            0);
  EXPECT_EQ(session()["state"], "refused");
}

TEST_F(TouchingRun, RefusesAnExpandingArrayWithoutAThermometer) {
  ASSERT_NO_FATAL_FAILURE(start_touching_simulator());
  write("grows.toml", replaced(text_of(file("calibrator.toml")), "tip_radius_mm = .*",
                               "$&\nalpha_um_per_m_K = 12\nu_alpha_um_per_m_K = 1"));
  write_touching_configuration();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const auto refused = run(calibrate_command("grows.toml"));
  EXPECT_EQ(refused.code, 5) << refused.out << refused.err;
  EXPECT_THAT(refused.err,
              HasSubstr("add artefact_sensor or artefact_C, and u_artefact_K, to [evemu]"));
}

TEST_F(TouchingRun, RefusesTheCalibratorOfAnotherArtefactAtItsFirstBall) {
  ASSERT_NO_FATAL_FAILURE(start_touching_simulator());
  write("other.toml",
        replaced(text_of(file("calibrator.toml")), "radius_mm = 12[.0-9]*", "radius_mm = 10"));
  write_touching_configuration();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const auto refused = calibrate_touching("other.toml");
  EXPECT_EQ(refused.code, 1) << refused.err;
  EXPECT_THAT(refused.out, HasSubstr("calibrator file of another artefact, or another tip"));
  EXPECT_TRUE(goes_on("counter_card"));
}

TEST_F(TouchingRun, RefusesWithoutAProbeAndWithAnInvalidCalibratorFile) {
  ASSERT_NO_FATAL_FAILURE(start_touching_simulator());
  write_touching_configuration(kAccepting, "off", "");
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const auto refused = run(calibrate_command("calibrator.toml"));
  EXPECT_EQ(refused.code, 5);
  EXPECT_THAT(refused.err, HasSubstr("neither [probe] nor [cmm]"));
  write("none.toml", "[calibrator]\nname = \"none\"\n");
  const auto unread = run(calibrate_command("none.toml"));
  EXPECT_EQ(unread.code, 3);
  EXPECT_THAT(unread.err, HasSubstr("tip_radius_mm"));
}

}  // namespace
}  // namespace abbe::test

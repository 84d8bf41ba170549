/// From the wire to the model and back: a calibration, what it is worth, and the same once more
/// from its recording.

#include <gmock/gmock.h>

#include <cmath>
#include <sstream>

#include "spine.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

struct ShortRun : Spine {
  ShortRun() : Spine("BC") {}

  void start_everything() {
    write_path("path.csv", path());
    start_simulator();
    const auto truth = run({ABBE_SIM_PROGRAM, "truth", "--config", file("sim.toml"), "--grid", "5",
                            "5", "5", "-o", file("truth.csv")});

    ASSERT_EQ(truth.code, 0) << truth.err;
    hold_simulator();
#ifdef ABBE_WITH_DDS
    write_configuration("child");
    start_abbed();
    watch_ =
        start({ABBE_WATCH_PROGRAM, "--domain", domain_.text(), "--profile", ABBE_LOOPBACK_PROFILE,
               "--json", "--compare", file("truth.csv"), "--timeout-s", "100"},
              "watch");
#else
    write_configuration("off");
    start_abbed();
#endif
  }

  /// The line of abbe-watch with the residual errors of the received model; null without one.
  json comparison() const {
    std::istringstream lines{watch_->out()};
    for (std::string line; std::getline(lines, line);) {
      const json said = json::parse(line, nullptr, false);
      if (said.is_object() && said.contains("comparison")) return said["comparison"];
    }
    return {};
  }

  /// They swing by 0.1 rad to both sides; their encoders count from 0 to 2 pi.
  void expect_rotary_axes_swing() {
    const auto swings = [](const json& rad) {
      return rad.is_number() && std::abs(rad.get<double>()) < 0.1001;
    };
    bool moved = false;
    EXPECT_TRUE(eventually([&] {
      const json position = status()["position_m"];
      if (position.size() != 5 || !swings(position[3]) || !swings(position[4])) return false;
      moved = moved || position[3] < -0.01;
      return moved;
    })) << status().dump(1);
  }

  void expect_subscriber_sees_a_smaller_error() {
#ifdef ABBE_WITH_DDS
    EXPECT_EQ(watch_->wait_for_end(), 0) << watch_->err();
    const json compared = comparison();
    ASSERT_TRUE(compared.is_object());
    // The tracker's noise on the blocks of this run, amplified by the fit, stays below a
    // micrometre; the error is 60.
    EXPECT_GT(compared["before_mean_um"], 30.0);
    EXPECT_LT(compared["after_mean_um"], 0.05 * compared["before_mean_um"].get<double>());
#endif
  }

  void expect_the_same_again(const std::vector<std::string>& options) {
    std::vector<std::string> command{ABBE_PROGRAM, "replay", "--json", recordings().front()};
    command.insert(command.end(), options.begin(), options.end());
    const auto replayed = run(command);
    EXPECT_EQ(replayed.code, 0) << replayed.err;
    const json said = json::parse(replayed.out, nullptr, false);
    ASSERT_TRUE(said.is_object()) << replayed.out;
    EXPECT_EQ(said["live_model_ids"].size(), 1u);
    EXPECT_TRUE(said["same_as_live"]) << said.dump(1);
    EXPECT_EQ(said["losses"], json::array());
  }

  void expect_the_recording_gives_the_model(const std::string& id) {
    const auto identified = run({ABBE_PROGRAM, "identify", "otf", "--recording",
                                 recordings().front(), "-o", file("again"), "--json"});
    EXPECT_EQ(identified.code, 0) << identified.err;
    const json said = json::parse(identified.out, nullptr, false);
    ASSERT_TRUE(said.is_object()) << identified.out;
    EXPECT_EQ(said["id"], id);
    EXPECT_TRUE(std::filesystem::exists(file("again/report.html")));
  }

  std::unique_ptr<Program> watch_;
};

TEST_F(ShortRun, IsCalibratedPublishedRecordedAndReplayedTheSame) {
  ASSERT_NO_FATAL_FAILURE(start_everything());
  const auto calibrated = calibrate("path.csv");
  ASSERT_EQ(calibrated.code, 0) << calibrated.out << calibrated.err;

  // Where others keep the processors busy, answers may miss their cycles for half a second: STALE,
  // as it should.
  EXPECT_TRUE(eventually([&] { return status()["model"]["state"] == "ACTIVE"; }))
      << status().dump(1);
  const json model = status()["model"];
  expect_rotary_axes_swing();
  ASSERT_NO_FATAL_FAILURE(expect_subscriber_sees_a_smaller_error());
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
  ASSERT_EQ(recordings().size(), 1u);
  EXPECT_EQ(recordings().front().extension(), ".mcap");  // closed: else .part
  expect_the_same_again({});
  expect_the_same_again({"--raw"});
  expect_the_recording_gives_the_model(model["id"]);
}

struct WrongPath : Spine {
  /// Begins at the first vertex of the driven path and determines all tables, as that one does.
  /// From there on Y is reversed: the first leg that is driven is up to 46 mm away from its legs.
  static Vertices other_path() {
    Vertices other = path();
    for (std::size_t i = 1; i < other.size(); ++i) other[i][1] = -other[i][1];
    return other;
  }
};

TEST_F(WrongPath, IsRefusedAndTheDaemonGoesOn) {
  write_path("path.csv", path());
  write_path("other.csv", other_path());
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  hold_simulator();
  write_configuration();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const auto refused = calibrate("other.csv");
  EXPECT_EQ(refused.code, 1) << refused.err;
  EXPECT_THAT(refused.out, HasSubstr("refused"));
  EXPECT_THAT(refused.out, HasSubstr("another path is being driven"));
  EXPECT_TRUE(goes_on("encoder"));
  EXPECT_EQ(abbed_->stop(), 0);

  // 1: the recording holds no run that could be identified; the command must report it.
  const auto replayed = run({ABBE_PROGRAM, "replay", "--json", recordings().front()});
  EXPECT_EQ(replayed.code, 1) << replayed.err;
  const json said = json::parse(replayed.out, nullptr, false);
  ASSERT_TRUE(said.is_object()) << replayed.out << replayed.err;
  EXPECT_THAT(said["calibrations"].at(0)["reason"], HasSubstr("another path is being driven"));
}

}  // namespace
}  // namespace abbe::test

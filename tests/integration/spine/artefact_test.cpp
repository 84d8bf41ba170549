/// `abbe calibrate artefact`: the command, the daemon and a simulated measuring machine over I++
/// DME.

#include <gmock/gmock.h>

#include <cmath>
#include <csignal>
#include <fstream>
#include <random>

#include "abbe/base/control_protocol.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "counter_card_run.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

struct ArtefactRun : CounterCardRun {
  static constexpr double kNoise_um = 0.3;
  static constexpr double kMachine_um = 0.4;
  static constexpr int kBalls = 9;
  /// The artefact lies beside the travel of the axes.
  static constexpr const char* kVolume =
      "volume_min_mm = [-100, -100, -200]\nvolume_max_mm = [500, 500, 200]\n";
  static constexpr double kAt_mm = 100;  // beside where the machine stands: (0, 0, 0)

  /// Nine balls in an L and two faces; `off_mm`: how far each coordinate is from nominal.
  static std::string artefact(double off_mm, double u_block_rad, double at_mm = 0.0) {
    std::mt19937_64 random(11);
    std::normal_distribution<double> off(0.0, off_mm);
    std::string text = "[calibrator]\nname = \"L\"\ntip_radius_mm = 1.5\n";

    for (int i = 1; i <= kBalls; ++i) {
      const double along = 60.0 * (i <= 5 ? i - 1 : i - 5);
      const double x = i <= 5 ? along : 0.0, y = i <= 5 ? 0.0 : along;
      text += "[[ball]]\nnumber = " + std::to_string(i) +
              "\nx_mm = " + std::to_string(at_mm + x + off(random)) +
              "\ny_mm = " + std::to_string(at_mm + y + off(random)) +
              "\nz_mm = " + std::to_string(60 + off(random)) +
              "\nradius_mm = " + std::to_string(12.7 + off(random)) + "\n";
    }

    const double c = std::cos(u_block_rad), s = std::sin(u_block_rad);
    text += "[[block]]\nnumber = 1\nnormal = [" + std::to_string(s) + ", 0, " + std::to_string(c) +
            "]\nx_mm = " + std::to_string(at_mm + 60) + "\ny_mm = " + std::to_string(at_mm + 60) +
            "\nz_mm = 40\nhalf_size_mm = 10\n";
    text += "[[block]]\nnumber = 2\nnormal = [0, " + std::to_string(-c) + ", " + std::to_string(s) +
            "]\nx_mm = " + std::to_string(at_mm + 90) + "\ny_mm = " + std::to_string(at_mm + 80) +
            "\nz_mm = 45\nhalf_size_mm = 10\n";

    return text;
  }
  static std::string machine_table(int port) {
    return "[cmm]\nhost = \"127.0.0.1\"\nport = " + std::to_string(port) +
           "\nu_position_um = " + std::to_string(kMachine_um) + "\n";
  }
  /// The daemon with nothing but a measuring machine. `more`: faults of the simulation.
  void start(const std::string& more = {}) {
    write_path("path.csv", {{0, 0, -50}, {1, 0, -50}});
    write("nominal.toml", artefact(0.0, 0.0));
    write("true.toml", artefact(0.05, 2e-3, kAt_mm));
    write("machine.toml", text_of(file("machine.toml")) + machine_table(0));
    write("sim.toml", replaced(text_of(file("sim.toml")), "standstill_s = [0-9]+",
                               "standstill_s = 1\nstart_when_streaming = false") +
                          "[sim.cmm]\nartefact = \"true.toml\"\nnoise_um = " +
                          std::to_string(kNoise_um) + "\n" + more);
    ASSERT_NO_FATAL_FAILURE(start_simulator());
    write_configuration_of(machine_table(port("cmm_port")) + kVolume);
    ASSERT_NO_FATAL_FAILURE(start_abbed());
    ASSERT_TRUE(eventually([&] { return samples("cmm") > 2; })) << status().dump(1);
  }
  [[nodiscard]] std::vector<std::string> command(std::vector<std::string> more = {}) const {
    std::vector<std::string> all{
        ABBE_PROGRAM, "calibrate",        "artefact", "--calibrator",          file("nominal.toml"),
        "-c",         file("abbed.toml"), "-o",       file("calibrator.toml"), "--at-mm",
        "100,100,0"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  [[nodiscard]] Outcome calibrate(std::vector<std::string> more = {}) const {
    return run(command(std::move(more)));
  }
  /// The daemon's status of the touches; this request counts as a client that follows the job.
  [[nodiscard]] json touches() const {
    const auto answer = daemon::ask_daemon(file("run/control.sock"), {{"do", "touches"}});
    return answer ? *answer : json{{"running", false}, {"reason", ""}, {"touches", json::array()}};
  }
  [[nodiscard]] json machine() const {
    const auto answer = daemon::ask_daemon(file("run/control.sock"), {{"do", "machine"}});
    return answer ? *answer : json{{"release_awaited", false}};
  }
  /// The tip does not move during fifty reports of its position, and the status contains the
  /// instruction to release it.
  void expect_standing_until_released() const {
    const json tip = machine()["tip_m"];
    EXPECT_TRUE(machine()["release_awaited"]) << machine().dump();
    EXPECT_EQ(status()["release_awaited"]["command"], "abbe machine release");
    EXPECT_THAT(run({ABBE_PROGRAM, "status", "-c", file("abbed.toml")}).out,
                HasSubstr("abbe machine release"));
    const auto refused = calibrate();
    EXPECT_EQ(refused.code, 5) << refused.out;
    EXPECT_THAT(refused.err, HasSubstr("abbe machine release"));
    EXPECT_EQ(machine()["tip_m"], tip);
  }
  void release() const {
    EXPECT_EQ(run({ABBE_PROGRAM, "machine", "release", "-c", file("abbed.toml")}).code, 0);
    EXPECT_TRUE(eventually([&] {
      const auto at =
          daemon::ask_daemon(file("run/control.sock"), {{"do", "touch"}, {"where", true}});
      return at.has_value();
    })) << status().dump(1);
  }
  [[nodiscard]] bool has_touched() const { return !touches()["touches"].empty(); }
  [[nodiscard]] std::size_t lines_of(const std::string& name) const {
    const std::string text = text_of(file(name));
    return text.empty() ? 0
                        : static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) - 1;
  }
  [[nodiscard]] std::size_t kept_touches() const { return lines_of("calibrator.touches.csv"); }
  [[nodiscard]] std::size_t touches_aside() const {
    return lines_of("calibrator.touches.partial.csv");
  }
};

TEST_F(ArtefactRun, FindsTheBallsWithinTheStatedUncertainty) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto done = calibrate({"--points", "9", "--block-points", "5"});
  ASSERT_EQ(done.code, 0) << done.out << done.err;
  EXPECT_EQ(kept_touches(), kBalls * 9u + 2u * 5u);
  const auto found = daemon::read_calibrator_toml(file("calibrator.toml"));
  const auto truth = daemon::read_calibrator_toml(file("true.toml"));
  ASSERT_TRUE(found) << found.error().text;
  ASSERT_TRUE(truth) << truth.error().text;

  for (std::size_t i = 0; i < kBalls; ++i) {
    const auto& ball = found->calibrator.balls[i];
    const auto& is = truth->calibrator.balls[i];
    // Four standard uncertainties per coordinate: once in 16,000.
    EXPECT_LT((ball.centre_m - is.centre_m).cwiseAbs().maxCoeff(), 4.0 * ball.u_m)
        << "ball " << i + 1;
    EXPECT_GE(ball.u_m, 1e-6 * kMachine_um);
    EXPECT_LT(ball.u_m, 3e-6);  // not so large that anything would agree
    EXPECT_NEAR(ball.radius_m, is.radius_m, 4.0 * ball.u_m);
  }

  for (std::size_t i = 0; i < 2; ++i) {
    const auto& block = found->calibrator.blocks[i];
    EXPECT_LT((block.normal - truth->calibrator.blocks[i].normal.normalized()).norm(),
              4.0 * block.u_rad);
  }
}

TEST_F(ArtefactRun, ReportsWhyTheMachineRefusedATouchAndKeepsTheOthers) {
  ASSERT_NO_FATAL_FAILURE(start());
  write("nominal.toml",
        replaced(artefact(0.0, 0.0), "number = 3\nx_mm = 120", "number = 3\nx_mm = 150"));
  write("calibrator.touches.csv", "of an earlier run\n");
  const auto refused = calibrate({"--points", "5"});
  EXPECT_EQ(refused.code, 1) << refused.out;
  EXPECT_THAT(refused.err, HasSubstr("touch 11 of"));
  EXPECT_THAT(refused.err, HasSubstr("1006 Surface not found"));
  EXPECT_THAT(refused.err, HasSubstr("raise it"));
  EXPECT_EQ(touches_aside(), 10u);
  EXPECT_EQ(text_of(file("calibrator.touches.csv")), "of an earlier run\n");
  EXPECT_FALSE(std::filesystem::exists(file("calibrator.toml")));
}

TEST_F(ArtefactRun, ReportsThatTheConnectionToTheMachineWasLost) {
  ASSERT_NO_FATAL_FAILURE(start());
  Program running(command({"--points", "100"}), file("artefact"));
  ASSERT_TRUE(eventually([&] { return has_touched(); }));
  simulator_->stop();
  EXPECT_EQ(running.wait_for_end(), 1);
  EXPECT_THAT(running.err(), HasSubstr("was not made"));
  EXPECT_THAT(running.err(), HasSubstr("touches were made before"));
  const auto away = calibrate();
  EXPECT_EQ(away.code, 5) << away.err;
  EXPECT_THAT(away.err, HasSubstr("not ready"));
}

TEST_F(ArtefactRun, EndsTheTouchingWhenInterrupted) {
  ASSERT_NO_FATAL_FAILURE(start());
  for (const int signal : {SIGINT, SIGHUP}) {
    Program running(command({"--points", "100"}), file("artefact"));
    ASSERT_TRUE(eventually([&] { return touches()["running"] == true && has_touched(); }));
    running.signal(signal);
    EXPECT_EQ(running.wait_for_end(), 1);
    EXPECT_THAT(running.err(),
                testing::ContainsRegex(
                    "cancelled; the machine is stopped: AbortE was answered.*the tip was "
                    "reported at X "));
    expect_standing_until_released();
    release();
    EXPECT_LT(touches_aside(), kBalls * 100u);
    EXPECT_GT(touches_aside(), 0u);
    EXPECT_EQ(kept_touches(), 0u);
  }
}

TEST_F(ArtefactRun, EndsTheTouchingWhenTheClientHasEnded) {
  ASSERT_NO_FATAL_FAILURE(start());
  Program running(command({"--points", "100"}), file("artefact"));
  ASSERT_TRUE(eventually([&] { return has_touched(); }));
  const auto before = touches()["touches"].size();
  running.signal(SIGKILL);
  (void)running.wait_for_end();
  // To ask how far it is would be to look on; where the machine is may be asked.
  ASSERT_TRUE(eventually([&] { return machine().value("release_awaited", false); }));
  EXPECT_THAT(touches()["reason"].get<std::string>(), HasSubstr("no client requested the touches"));
  expect_standing_until_released();
  EXPECT_GE(touches()["touches"].size(), before);
  EXPECT_LT(touches()["touches"].size(), touches()["asked"].get<std::size_t>());
}

TEST_F(ArtefactRun, NeedsAMeasuringMachineAndKnownFaces) {
  write_path("path.csv", {{0, 0, -50}, {1, 0, -50}});
  write("nominal.toml", artefact(0.0, 0.0));

  ASSERT_NO_FATAL_FAILURE(start_simulator());
  write_configuration();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const auto none = calibrate();
  EXPECT_EQ(none.code, 5);
  EXPECT_THAT(none.err, HasSubstr("[cmm]"));
  write("nominal.toml",
        replaced(artefact(0.0, 0.0), "x_mm = 90[.0]*\ny_mm = 80[.0]*\nz_mm = 45\n", ""));
  const auto faceless = calibrate();
  EXPECT_EQ(faceless.code, 3);
  EXPECT_THAT(faceless.err, HasSubstr("block 2"));
  write("nominal.toml", replaced(artefact(0.0, 0.0), "number = 4", "number = 40"));
  const auto unknown = calibrate();
  EXPECT_EQ(unknown.code, 3);
  EXPECT_THAT(unknown.err, HasSubstr("ball number"));
}

}  // namespace
}  // namespace abbe::test

/// `abbe identify joint` with a run that the daemon recorded, and a ball array of the same machine.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <random>
#include <variant>

#include "abbe/methods/otf/identification.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/replay/replay.hpp"
#include "abbe_command.hpp"
#include "synthetic_otf_recording.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// The run of a recording, as it was acquired.
OtfRun recorded_run(const fs::path& file) {
  const auto reader = RecordingReader::open(file);
  const auto config = recorded_config(*reader, file.string());
  OtfRun found;
  const auto replayed =
      replay(*reader, *config,
             {.runs = [&found](CalibrationRun run) { found = std::get<OtfRun>(std::move(run)); }});
  EXPECT_TRUE(replayed) << replayed.error().text;
  return found;
}

std::string tracker_csv(const OtfRun& run) {
  std::string text = "time_s,tracker_x_mm,tracker_y_mm,tracker_z_mm\n";
  for (const RunPoint& p : run.points)
    text += fmt::format(
        "{:.9f},{:.17g},{:.17g},{:.17g}\n",
        std::chrono::duration<double>(p.device_time - run.points.front().device_time).count(),
        1e3 * p.p_tracker_m[0], 1e3 * p.p_tracker_m[1], 1e3 * p.p_tracker_m[2]);
  return text;
}

/// V at the balls of an array in eight positions, with 0.5 um of noise.
std::string array_errors_csv() {
  const auto truth = test::synthetic_truth();
  const Eigen::Vector3d tool(truth.target_offset_m[0], truth.target_offset_m[1],
                             truth.target_offset_m[2]);
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 0.5);
  std::string text = "position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
  for (int position = 1; position <= 8; ++position) {
    const Eigen::Matrix3d R =
        (Eigen::AngleAxisd(0.8 * position, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(0.5 * std::sin(1.7 * position), Eigen::Vector3d::UnitY()))
            .matrix();
    Eigen::Vector3d first = Eigen::Vector3d::Zero();
    for (int ball = 1; ball <= 5; ++ball) {
      const Eigen::Vector3d place = ball <= 3 ? Eigen::Vector3d(0.024 * (ball - 1), 0, 0)
                                              : Eigen::Vector3d(0, 0.022 * (ball - 3), 0);
      const Eigen::Vector3d q = R * place;
      const Eigen::Vector3d V_um = 1e6 * (sim::position_m(truth, q, {}) - q - tool);
      if (ball == 1) first = V_um;
      const Eigen::Vector3d scatter =
          ball == 1 ? Eigen::Vector3d(0, 0, 0)
                    : Eigen::Vector3d(noise(random), noise(random), noise(random));
      const Eigen::Vector3d e = V_um - first + scatter;
      text += fmt::format("{},{},{:.12g},{:.12g},{:.12g},{:.12g},{:.12g},{:.12g}\n", position, ball,
                          1e3 * q.x(), 1e3 * q.y(), 1e3 * q.z(), e.x(), e.y(), e.z());
    }
  }
  return text;
}

class JointRecording : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("joint_recording_{}", ::getpid());
    fs::create_directories(folder_);
    recording_ = test::record_synthetic_run(folder_);
    test::write_text(folder_ / "machine.toml", test::synthetic_machine_toml());
    test::write_text(folder_ / "path.csv", test::synthetic_path_csv());
    test::write_text(folder_ / "tracker.csv", tracker_csv(recorded_run(recording_)));
    test::write_text(folder_ / "errors.csv", array_errors_csv());
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static test::Ran identify(const std::string& run, const std::string& out,
                            const std::string& machine = "machine.toml") {
    test::write_text(folder_ / "parts.toml",
                     "[[run]]\nname = \"run\"\n" + run +
                         "[[array]]\nname = \"array\"\nerrors = \"errors.csv\"\npositions = 8\n");
    return test::run_abbe(
        folder_,
        fmt::format("identify joint --machine {} --parts parts.toml -o {} --json", machine, out));
  }
  static std::string recorded() {
    return fmt::format("recording = \"{}\"\n", recording_.filename().string());
  }

  static inline fs::path folder_, recording_;
};

TEST_F(JointRecording, GivesTheNumbersOfTheFilesOfTheSameRun) {
  const auto of_recording = identify(recorded(), "recorded"),
             of_files = identify("path = \"path.csv\"\ntracker = \"tracker.csv\"\n", "files");
  ASSERT_EQ(of_recording.exit, 0) << of_recording.out << of_recording.err;
  ASSERT_EQ(of_files.exit, 0) << of_files.out << of_files.err;
  const auto one = read_model(folder_ / "recorded/model.json"),
             two = read_model(folder_ / "files/model.json");
  ASSERT_TRUE(one && two);
  // files contain decimal numbers in mm
  EXPECT_LT((one->model.U() - two->model.U()).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((one->model.covariance() - two->model.covariance()).norm(),
            1e-6 * two->model.covariance().norm());
  EXPECT_EQ(one->statistics.samples, two->statistics.samples);
  EXPECT_EQ(one->inputs.size(), 4u);  // machine, parts, recording, errors
  EXPECT_EQ(made_on_simulated_devices(*one), true) << "as recorded, not as in machine.toml";
  EXPECT_EQ(made_on_simulated_devices(*two), false);
}

TEST_F(JointRecording, IsRefusedBesideFiles) {
  const auto ran = identify(recorded() + "path = \"path.csv\"\n", "none");
  EXPECT_EQ(ran.exit, 3) << ran.out;
  EXPECT_THAT(ran.err, AllOf(HasSubstr("parts.toml"), HasSubstr("recording"),
                             HasSubstr("must not be given beside")));
}

TEST_F(JointRecording, OfAnotherMachineIsRefused) {
  std::string machine = test::synthetic_machine_toml();
  machine.replace(machine.find("[w b X Y Z t]"), 13, "[w X' b Y Z t]");
  test::write_text(folder_ / "other.toml", machine);
  const auto ran = identify(recorded(), "none", "other.toml");
  EXPECT_EQ(ran.exit, 3) << ran.out;
  EXPECT_THAT(ran.err, AllOf(HasSubstr("run: "), HasSubstr("chain")));
}

TEST_F(JointRecording, ThatIsNoRecordingIsNamed) {
  const auto ran = identify("recording = \"path.csv\"\n", "none");
  EXPECT_NE(ran.exit, 0);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("run: "), HasSubstr("path.csv")));
}

TEST_F(JointRecording, ASharedOffsetNeedsItsUncertainty) {
  std::string machine = test::synthetic_machine_toml();
  machine += "u_range_offset_um = 0\n";  // of [tracker], the last table
  test::write_text(folder_ / "exact.toml", machine);
  const auto ran = identify(recorded() + "range_offset = \"home 1\"\n", "none", "exact.toml");
  EXPECT_EQ(ran.exit, 3) << ran.out;
  EXPECT_THAT(ran.err, AllOf(HasSubstr("range_offset"), HasSubstr("u_range_offset_um")));
}

}  // namespace
}  // namespace abbe::daemon

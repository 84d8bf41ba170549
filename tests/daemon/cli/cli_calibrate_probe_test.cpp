/// `abbe calibrate probe` on recordings of touches.

#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "abbe/recording/recorder.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class CliCalibrateProbe : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("probe_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  void record(const std::vector<protocol::ProbeTrigger>& touches) const {
    auto recorder = Recorder::open(example_options(folder_), example_info(), Recorder::WallTime{});
    ASSERT_TRUE(recorder);
    for (const auto& touch : touches) {
      recorder->record(touch, "probe");
      recorder->flush();  // a chunk each
    }
    ASSERT_TRUE(recorder->close());
  }
  /// Exit code and standard output.
  [[nodiscard]] std::pair<int, std::string> calibrate(const std::string& more) const {
    const auto out = (folder_ / "stdout").string();
    const std::string command =
        "'" + std::string(ABBE_PROGRAM) + "' calibrate probe --recording '" +
        (folder_ / "run.mcap").string() + "' " + more + " >'" + out + "' 2>&1";
    const int status = std::system(command.c_str());
    std::ostringstream text;
    text << std::ifstream(out).rdbuf();
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text.str()};
  }

  fs::path folder_;
};

/// A surface at z = 0.3 m, approached downwards; the edge comes 2 ms after the contact.
std::vector<protocol::ProbeTrigger> touches_at(const std::vector<double>& feeds_m_s) {
  std::vector<protocol::ProbeTrigger> touches;
  for (const double feed : feeds_m_s) {
    for (std::uint32_t i = 0; i < 4; ++i) {
      protocol::ProbeTrigger touch = example_touch(static_cast<std::uint32_t>(touches.size()));
      touch.touch_flags = 0;
      touch.missing_mask = 0;
      touch.speed_m_s = feed;
      touch.position = {0.1, 0.2, 0.3 - 2e-3 * feed};
      touch.velocity = {0.0, 0.0, -feed};
      touches.push_back(touch);
    }
  }

  return touches;
}

TEST_F(CliCalibrateProbe, FindsTheDelayFromThreeFeeds) {
  record(touches_at({1e-3, 4e-3, 8e-3}));
  const auto [exit, out] = calibrate("--json");
  ASSERT_EQ(exit, 0) << out;
  const auto found = nlohmann::json::parse(out);
  EXPECT_NEAR(found["delay_us"].get<double>(), 2000.0, 0.01);
  EXPECT_EQ(found["feeds"], 3);
}

TEST_F(CliCalibrateProbe, ADamagedRecordingShowsItsResultAndEndsWithOne) {
  record(touches_at({1e-3, 4e-3, 8e-3, 1e-3, 4e-3, 8e-3, 1e-3, 4e-3, 8e-3}));
  damage_chunk(folder_ / "run.mcap", 1);
  const auto [exit, out] = calibrate("");
  EXPECT_EQ(exit, 1);
  EXPECT_THAT(out, HasSubstr("delay_us = "));
  EXPECT_THAT(out, HasSubstr("the recording is damaged: chunk 2"));
}

TEST_F(CliCalibrateProbe, ReportsWhatIsMissing) {
  record(touches_at({1e-3, 8e-3}));
  const auto [exit, out] = calibrate("");
  EXPECT_EQ(exit, 1);
  EXPECT_THAT(out, HasSubstr("2 feeds, at least 3 are needed"));
}

TEST_F(CliCalibrateProbe, RefusesContactsThatLieOnNoLine) {
  auto touches = touches_at({1e-3, 4e-3, 8e-3});
  for (std::size_t i = 0; i < 4; ++i) touches[i].position[2] += 20e-6;  // the part was moved
  record(touches);
  const auto [exit, out] = calibrate("");
  EXPECT_EQ(exit, 1);
  EXPECT_THAT(out, HasSubstr("are not linear in the feed"));
}

TEST_F(CliCalibrateProbe, EvaluatesOneProbeIfAProbeIsNamed) {
  record(touches_at({1e-3, 4e-3, 8e-3}));  // of probe 7
  EXPECT_EQ(calibrate("--probe 7").first, 0);
  EXPECT_EQ(calibrate("--probe 8").first, 1);
}

}  // namespace
}  // namespace abbe::daemon

/// Replays of a recorded calibration by the page: what they give, that there is one at a time, and
/// what ends them.

#include "abbe/web/replays.hpp"

#include <httplib.h>

#undef _res  // a macro of resolv.h, which changes headers of Eigen

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "abbe/tasks/replay_recording.hpp"
#include "page_fixture.hpp"
#include "synthetic_otf_recording.hpp"

namespace abbe::web {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::AnyOf;
using ::testing::HasSubstr;

/// A replay may end before a test that wants to see it run asks again.
constexpr int kAttempts = 20;

class ReplaysTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("abbe-replays-{}", ::getpid());
    name_ = daemon::test::record_synthetic_run(folder_).filename();
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static std::unique_ptr<Replays> replays(TaskLimits limits = {}) {
    return std::make_unique<Replays>(
        folder_, [](const std::string& line) { ADD_FAILURE() << line; }, limits);
  }
  static json outcome_of(const Replays& replays) {
    json status = replays.status();
    for (; status["state"] == "running"; status = replays.status())
      std::this_thread::sleep_for(1ms);
    return status;
  }
  static std::string failure_of(Replays& replays) {
    const auto begun = replays.begin(name_);
    EXPECT_TRUE(begun) << begun.error().text;
    const json outcome = outcome_of(replays);
    EXPECT_EQ(outcome["state"], "failed") << outcome;
    EXPECT_EQ(outcome["name"], name_);
    return outcome.value("error", std::string{});
  }

  static inline fs::path folder_;
  static inline std::string name_;
};

TEST_F(ReplaysTest, AReplayGivesWhatThatOfTheCommandLineGives) {
  const auto page = replays();
  EXPECT_EQ(page->status()["state"], "none");
  const auto begun = page->begin(name_);
  ASSERT_TRUE(begun) << begun.error().text;
  json outcome = outcome_of(*page);
  ASSERT_EQ(outcome["state"], "done") << outcome;
  EXPECT_EQ(outcome["name"], name_);

  const auto replayed = daemon::replay_recording({.file = folder_ / name_}, {}, {});
  ASSERT_TRUE(replayed) << replayed.error().text;
  json expected = daemon::replay_json(*replayed);
  ASSERT_EQ(expected["calibrations"].size(), 1u);
  EXPECT_EQ(expected["calibrations"][0]["accepted"], true);
  for (json* result : {&expected, &outcome["result"]}) result->erase("wall_s");
  EXPECT_EQ(outcome["result"], expected);
}

TEST_F(ReplaysTest, ASecondReplayIsRefusedUntilTheFirstHasEnded) {
  const auto page = replays();
  daemon::Result<void> second;
  for (int i = 0; second && i < kAttempts; ++i) {
    (void)outcome_of(*page);
    ASSERT_TRUE(page->begin(name_));
    second = page->begin(name_);
  }
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, daemon::ErrorCode::Refused);
  EXPECT_THAT(second.error().text, HasSubstr("another replay is running"));
  EXPECT_EQ(outcome_of(*page)["state"], "done");
  EXPECT_TRUE(page->begin(name_));
}

TEST_F(ReplaysTest, StoppingEndsARunningReplayAndEveryLaterOne) {
  json outcome;
  std::unique_ptr<Replays> page;
  for (int i = 0; outcome["state"] != "failed" && i < kAttempts; ++i) {
    page = replays();
    ASSERT_TRUE(page->begin(name_));
    page->stop();
    outcome = outcome_of(*page);
  }
  EXPECT_THAT(outcome.value("error", std::string{}), HasSubstr("abbe-web stops"));
  EXPECT_THAT(failure_of(*page), HasSubstr("abbe-web stops"));
}

TEST_F(ReplaysTest, AReplayEndsAtItsLimitsOfTimeAndMemory) {
  EXPECT_THAT(failure_of(*replays({.time = 0min})), HasSubstr("took longer than 0 min"));
  EXPECT_THAT(failure_of(*replays({.memory_bytes = 1})), HasSubstr("more than 0 MiB of memory"));
}

TEST_F(ReplaysTest, AFileThatIsNoRecordingIsNamed) {
  std::ofstream{folder_ / "text.mcap"} << "not a recording";
  const auto page = replays();
  ASSERT_TRUE(page->begin("text.mcap"));
  const json outcome = outcome_of(*page);
  EXPECT_EQ(outcome["state"], "failed");
  EXPECT_THAT(outcome.value("error", std::string{}), HasSubstr("is not an MCAP file"));
  EXPECT_FALSE(page->begin("gone.mcap"));
  EXPECT_FALSE(page->begin("../text.mcap"));
}

struct ReplayPage : test::PageFixture {
  void start_with_recording() {
    ASSERT_NO_FATAL_FAILURE(start());
    name_ = daemon::test::record_synthetic_run(folder_ / "data/recordings").filename();
  }
  [[nodiscard]] json status() const {
    const auto answer = browser().Get("/api/replay");
    return answer ? json::parse(answer->body) : json::object();
  }

  std::string name_;
};

TEST_F(ReplayPage, ShowsTheResultOfAReplay) {
  ASSERT_NO_FATAL_FAILURE(start_with_recording());
  const json request{{"name", name_}};
  EXPECT_EQ(post(log_in("view").headers, "/api/replay", request), 403);
  EXPECT_EQ(post(log_in("calibrate").headers, "/api/replay", request), 200);
  json seen = status();
  for (; seen["state"] == "running"; seen = status()) std::this_thread::sleep_for(100ms);
  ASSERT_EQ(seen["state"], "done") << seen;
  EXPECT_EQ(seen["name"], name_);
  EXPECT_EQ(seen["result"]["damage"], "");
}

TEST_F(ReplayPage, EndsWhileAReplayRuns) {
  ASSERT_NO_FATAL_FAILURE(start_with_recording());
  EXPECT_EQ(post(log_in("calibrate").headers, "/api/replay", {{"name", name_}}), 200);
  EXPECT_THAT(status()["state"], AnyOf("running", "done"));
  page_.reset();
  EXPECT_THAT(log(), ::testing::Not(::testing::Contains(HasSubstr("internal error"))));
}

}  // namespace
}  // namespace abbe::web

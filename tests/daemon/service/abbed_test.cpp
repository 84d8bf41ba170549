#include "abbe/service/abbed.hpp"

#include <gmock/gmock.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <thread>

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class AbbedTest : public ::testing::Test {
 protected:
  AbbedTest() {
    std::string name = testing::TempDir() + "abbed-XXXXXX";
    directory_ = ::mkdtemp(name.data());
    config_.machine.name = "mill";
    config_.daemon.data_dir = directory_;
    config_.daemon.runtime_dir = directory_;
    config_.recording.dir = directory_ / "recordings";
    config_.recording.min_free_bytes = 0;
    config_.control.socket = directory_ / "control.sock";
    config_.dds.socket = directory_ / "dds.sock";
    config_.dds.supervise = Supervise::Off;
  }
  ~AbbedTest() override { fs::remove_all(directory_); }

  [[nodiscard]] std::vector<fs::path> recordings() const {
    std::error_code missing;
    const fs::directory_iterator files{config_.recording.dir, missing}, end;
    return {files, end};
  }

  fs::path directory_;
  Config config_;
};

TEST_F(AbbedTest, ARefusedStartLeavesNoRecording) {
  std::ofstream{config_.control.socket} << "not a socket";
  const auto abbed = Abbed::start(config_, {});
  ASSERT_FALSE(abbed);
  EXPECT_THAT(abbed.error().text, HasSubstr("control.sock"));
  EXPECT_THAT(recordings(), IsEmpty());
}

TEST_F(AbbedTest, RecordsWhileItRunsAndRemovesEmptyFiles) {
  auto abbed = Abbed::start(config_, {});
  ASSERT_TRUE(abbed) << abbed.error().text;
  EXPECT_EQ(recordings().size(), 1u);
  abbed->reset();
  EXPECT_THAT(recordings(), IsEmpty());
  EXPECT_FALSE(fs::exists(config_.control.socket));
}

// As a disk that is read-only or not mounted.
TEST_F(AbbedTest, RunsWithoutADiskAndReportsIt) {
  config_.daemon.data_dir = directory_ / "data";
  config_.recording.dir = directory_ / "data" / "recordings";
  std::ofstream{directory_ / "data"} << "in the way";
  const auto abbed = Abbed::start(config_, {});
  ASSERT_TRUE(abbed) << abbed.error().text;
  EXPECT_THAT((*abbed)->warnings(), Contains(HasSubstr("nothing is recorded: ")));
  EXPECT_THAT((*abbed)->warnings(), Contains(HasSubstr("models")));
  EXPECT_TRUE((*abbed)->alive());
}

TEST_F(AbbedTest, ClosesTheRecordingOfAKilledDaemon) {
  fs::create_directories(config_.recording.dir);
  const fs::path left = config_.recording.dir / "abbe-killed.mcap.part";
  std::ofstream{left};
  auto abbed = Abbed::start(config_, {});
  ASSERT_TRUE(abbed) << abbed.error().text;
  while (fs::exists(left)) std::this_thread::yield();  // it holds nothing, and is removed
}

// What is removed later, and what never: OldRecordings.
TEST_F(AbbedTest, RemovesNoRecordingBeforeATimeServerCouldSetTheClock) {
  fs::create_directories(config_.recording.dir);
  const fs::path old = config_.recording.dir / "abbe-old.mcap";
  std::ofstream{old} << "old";
  fs::last_write_time(old, fs::file_time_type::clock::now() - std::chrono::days{3});
  config_.recording.keep = std::chrono::days{2};
  auto abbed = Abbed::start(config_, {});
  ASSERT_TRUE(abbed) << abbed.error().text;
  (*abbed)->cycle();
  abbed->reset();  // waits for the background tasks
  EXPECT_TRUE(fs::exists(old));
}

TEST_F(AbbedTest, ASecondDaemonIsRefusedAndTheFirstContinues) {
  const auto first = Abbed::start(config_, {});
  ASSERT_TRUE(first) << first.error().text;
  EXPECT_FALSE(Abbed::start(config_, {}));
  EXPECT_TRUE(fs::exists(config_.control.socket));
}

}  // namespace
}  // namespace abbe::daemon

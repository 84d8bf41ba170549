// The replay of a recording as a task: it can be stopped.

#include "abbe/tasks/replay_recording.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <string_view>

#include "synthetic_otf_recording.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class ReplayTask : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("replay_task_{}", ::getpid());
    recording_ = test::record_synthetic_run(folder_);
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static inline fs::path folder_, recording_;
};

TEST_F(ReplayTask, EndsSoonAfterItIsToStop) {
  int shown = 0;
  const Progress progress([&shown](std::string_view, double) { ++shown; },
                          [&shown] { return shown > 0; });
  const auto replayed = replay_recording({.file = recording_}, {}, progress);
  ASSERT_FALSE(replayed);
  EXPECT_EQ(replayed.error().code, ErrorCode::DataInsufficient);
  EXPECT_EQ(replayed.error().text, "replay: stopped before its end");
  EXPECT_EQ(shown, 1);
}

TEST_F(ReplayTask, EndsWhileTheFileIsOpened) {
  int asked = 0;
  const Progress progress({}, [&asked] { return ++asked > 1; });
  const auto replayed = replay_recording({.file = recording_}, {}, progress);
  ASSERT_FALSE(replayed);
  EXPECT_EQ(replayed.error().code, ErrorCode::DataInsufficient);
  EXPECT_THAT(replayed.error().text, HasSubstr("stopped before its end"));
  EXPECT_LE(asked, 4) << "the rest of its chunks is not read";
}

}  // namespace
}  // namespace abbe::daemon

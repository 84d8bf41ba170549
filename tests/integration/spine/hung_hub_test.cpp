/// abbed is stopped while its hub hangs: the process still ends.

#include <gmock/gmock.h>
#include <signal.h>

#include "hung_hub.hpp"
#include "spine.hpp"

namespace abbe::test {
namespace {

TEST_F(Spine, AbbedWhoseHubHangsEndsWithItsExitCode) {
  write_path("path.csv", path());
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  write_configuration();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const pid_t hub = thread_of(abbed_->pid(), "abbe-hub");
  ASSERT_GT(hub, 0);
  if (!stop_thread(hub)) GTEST_SKIP() << "ptrace is not allowed here";

  abbed_->signal(SIGTERM);
  keep_stopped_to_the_end(hub);
  EXPECT_EQ(abbed_->wait_for_end(), 70);
  EXPECT_THAT(abbed_->err(), testing::HasSubstr("the hub does not end within 5 s"));
}

}  // namespace
}  // namespace abbe::test

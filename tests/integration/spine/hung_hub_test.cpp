/// A hub that hangs is waited for by whoever stops abbed: the process ends all the same.

#include <gmock/gmock.h>
#include <sys/ptrace.h>
#include <sys/wait.h>

#include "spine.hpp"

namespace abbe::test {
namespace {

/// 0: there is none of that name.
pid_t thread_of(pid_t process, const std::string& name) {
  for (const auto& task : std::filesystem::directory_iterator{"/proc/" + std::to_string(process) + "/task"})
    if (text_of(task.path() / "comm") == name + "\n") return std::stoi(task.path().filename().string());
  return 0;
}

TEST_F(Spine, AbbedWhoseHubHangsEndsWithItsExitCode) {
  write_path("path.csv", path());
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  write_configuration();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const pid_t hub = thread_of(abbed_->pid(), "abbe-hub");
  ASSERT_GT(hub, 0);
  if (::ptrace(PTRACE_SEIZE, hub, nullptr, nullptr) != 0) GTEST_SKIP() << "ptrace is not allowed here";
  ASSERT_EQ(::ptrace(PTRACE_INTERRUPT, hub, nullptr, nullptr), 0);
  int status = 0;
  ASSERT_EQ(::waitpid(hub, &status, __WALL), hub);
  ASSERT_TRUE(WIFSTOPPED(status)) << "the hub stands, every other thread goes on";

  abbed_->signal(SIGTERM);
  while (::waitpid(hub, &status, __WALL) == hub && !WIFEXITED(status) && !WIFSIGNALED(status))
    (void)::ptrace(PTRACE_LISTEN, hub, nullptr, nullptr);
  EXPECT_EQ(abbed_->wait_for_end(), 70);
  EXPECT_THAT(abbed_->err(), testing::HasSubstr("the hub does not end within 5 s"));
}

}  // namespace
}  // namespace abbe::test

#include "abbe/base/exit_deadline.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <string>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;

TEST(ExitDeadline, EndsAProcessThatHangsWithItsMessageAndCode) {
  EXPECT_EXIT(
      {
        const ExitDeadline deadline(10ms, 70, "the hub hangs\n");
        for (;;) ::pause();
      },
      testing::ExitedWithCode(70), "the hub hangs");
}

/// stderr becomes a full pipe that nobody reads.
void leave_stderr_unread() {
  std::array<int, 2> ends{};
  if (::pipe(ends.data()) != 0) ::_exit(1);
  ::dup2(ends[1], STDERR_FILENO);
  const std::string much(1 << 20, 'x');
  ::fcntl(STDERR_FILENO, F_SETFL, O_NONBLOCK);
  while (::write(STDERR_FILENO, much.data(), much.size()) > 0) {
  }
  ::fcntl(STDERR_FILENO, F_SETFL, 0);
}

std::string stop_the_machine() {
  return "the machine was stopped\n";
}

TEST(ExitDeadline, EndsAProcessWhoseStderrNobodyReads) {
  EXPECT_EXIT(
      {
        leave_stderr_unread();
        const ExitDeadline deadline(10ms, 70, "the hub hangs\n");
        for (;;) ::pause();
      },
      testing::ExitedWithCode(70), "");
}

TEST(ExitDeadline, ActsBeforeItEndsAndReportsWhatItDid) {
  EXPECT_EXIT(
      {
        const ExitDeadline deadline(10ms, 70, "the hub hangs\n", &stop_the_machine);
        for (;;) ::pause();
      },
      testing::ExitedWithCode(70), "the hub hangs\nthe machine was stopped");
}

TEST(ExitDeadline, DoesNotAffectAProcessThatMeetsIt) {
  EXPECT_EXIT(
      {
        { const ExitDeadline deadline(60s, 70, "the hub hangs\n"); }
        ::_exit(0);
      },
      testing::ExitedWithCode(0), "^$");
}

}  // namespace
}  // namespace abbe::daemon

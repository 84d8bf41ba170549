#include "abbe/base/exit_deadline.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

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

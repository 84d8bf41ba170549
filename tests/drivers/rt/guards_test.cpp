// The guards themselves: a guard that never fires proves nothing.

#include <memory>

#include "abbe/protocol/time.hpp"
#include "rt_guards.hpp"

namespace abbe::tests {
namespace {

TEST(AllocationCount, SeesOperatorNewAndMalloc) {
  const AllocationCount allocations;
  const auto owned = std::make_unique<int>(1);
  void* volatile taken = std::malloc(10);
  std::free(taken);
  EXPECT_EQ(allocations.value(), 2u);
  EXPECT_EQ(*owned, 1);
}

TEST(OnlyExitAllowed, EndsTheProcessAtAnySystemCall) {
  if (!kSystemCallsAreOurs) GTEST_SKIP() << "ThreadSanitizer makes system calls of its own";
  EXPECT_EXIT(
      {
        allow_only_exit();
        syscall(SYS_getppid);
        syscall(SYS_exit_group, 0);
      },
      testing::KilledBySignal(SIGSYS), "");
}

}  // namespace
}  // namespace abbe::tests

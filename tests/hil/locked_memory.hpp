#pragma once
/// What drivers::DeviceThread does for a process whose deadlines count.

#include <sys/mman.h>
#include <sys/prctl.h>

namespace abbe::tests {

[[nodiscard]] inline bool lock_memory() {
  return ::prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0) == 0 && ::mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
}

}  // namespace abbe::tests

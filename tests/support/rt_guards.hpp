#pragma once
/// The two requirements on every real-time path, as checks for any receiver, ring or device:
///
///   expect_no_allocation(10'000, [&](std::size_t i) { receiver.receive(bytes_of(i), at, sink); });
///   expect_no_system_call([&] { receiver.receive(bytes, at, sink); });
///
/// Prepare everything outside the callable: it contains only the real-time path.

#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cstddef>

#include "allocation_count.hpp"
#include "sanitizers.hpp"

namespace abbe::tests {

/// Calls `path(i)` for i = 0 .. times - 1; none of the calls may allocate memory.
template <class Path>
void expect_no_allocation(std::size_t times, Path&& path) {
  const AllocationCount allocations;
  for (std::size_t i = 0; i < times; ++i) path(i);
  EXPECT_EQ(allocations.value(), 0u) << "allocations in " << times << " calls of a real-time path";
}

/// Installs a filter: the kernel kills this process at any further system call except exit_group.
inline void allow_only_exit() {
  std::array<sock_filter, 4> filter{{
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_exit_group, 0, 1),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
  }};
  sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 ||
      prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) != 0) {
    _exit(3);
  }
}

#ifdef ABBE_THREAD_SANITIZER
// ThreadSanitizer maps its shadow memory on demand and uses futexes
inline constexpr bool kSystemCallsAreOurs = false;
#else
inline constexpr bool kSystemCallsAreOurs = true;
#endif

/// Runs `path` in a child process that is killed at any system call. Skips (does not fail) under
/// ThreadSanitizer, whose own system calls cannot be distinguished from those of `path`.
template <class Path>
void expect_no_system_call(Path&& path) {
  if constexpr (kSystemCallsAreOurs) {
    EXPECT_EXIT(
        {
          allow_only_exit();
          path();
          syscall(SYS_exit_group, 0);  // not exit(): destructors and leak checks make system calls
        },
        testing::ExitedWithCode(0), "")
        << "a system call was made in a real-time path";
  } else {
    GTEST_SKIP() << "ThreadSanitizer makes system calls of its own";
  }
}

}  // namespace abbe::tests

#pragma once
/// A task in a child process. The child is forked early and starts the task later, on request: Fast
/// DDS starts threads in this process, and a process with threads must not fork.

#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <new>
#include <utility>

namespace abbe::bench {

/// Memory shared by parent and child; `T` must not own memory.
template <class T>
[[nodiscard]] T& shared_memory() {
  void* memory =
      ::mmap(nullptr, sizeof(T), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) std::abort();
  return *new (memory) T;  // stays until the process ends
}

/// A child process that runs `work` after begin(). It ends when `work` returns, or when this
/// process ends.
class ForkedTask {
 public:
  template <class Work>
  explicit ForkedTask(Work&& work) {
    if (::pipe(start_.data()) != 0) std::abort();
    child_ = ::fork();
    if (child_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    char go = 0;
    if (::read(start_[0], &go, 1) == 1) std::forward<Work>(work)();
    ::_exit(0);
  }
  ForkedTask(const ForkedTask&) = delete;
  ForkedTask& operator=(const ForkedTask&) = delete;
  ~ForkedTask() {
    if (child_ > 0) ::kill(child_, SIGKILL);
    wait();
  }

  void begin() {
    if (::write(start_[1], "g", 1) != 1) std::abort();
  }
  void wait() {
    if (child_ > 0) ::waitpid(child_, nullptr, 0);
    child_ = 0;
  }

 private:
  std::array<int, 2> start_{};
  pid_t child_ = 0;
};

}  // namespace abbe::bench

#pragma once
/// Stops one thread of a program, while its other threads go on: what a hub looks like that hangs.
/// By ptrace, so the thread that stops it must be the one that waits for the program's end.

#include <sys/ptrace.h>
#include <sys/wait.h>

#include <filesystem>
#include <string>

#include "program.hpp"

namespace abbe::test {

/// 0: there is none of that name.
inline pid_t thread_of(pid_t process, const std::string& name) {
  for (const auto& task :
       std::filesystem::directory_iterator{"/proc/" + std::to_string(process) + "/task"})
    if (text_of(task.path() / "comm") == name + "\n")
      return std::stoi(task.path().filename().string());
  return 0;
}

/// False: not permitted here.
inline bool stop_thread(pid_t thread) {
  int status = 0;
  return ::ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) == 0 &&
         ::ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) == 0 &&
         ::waitpid(thread, &status, __WALL) == thread && WIFSTOPPED(status);
}

/// The thread stays stopped until its process ends.
inline void keep_stopped_to_the_end(pid_t thread) {
  int status = 0;
  while (::waitpid(thread, &status, __WALL) == thread && !WIFEXITED(status) && !WIFSIGNALED(status))
    (void)::ptrace(PTRACE_LISTEN, thread, nullptr, nullptr);
}

}  // namespace abbe::test

#pragma once
/// Ends the process if its orderly shutdown hangs, for example because a thread does not return.
/// If an ExitDeadline is not destroyed within `time_limit`, the process calls `last_act`, writes
/// `message` and the text that `last_act` returned to stderr, and exits with `exit_code` without
/// running destructors. If no process reads stderr, writing to it delays the exit by at most 0.2 s.

#include <chrono>
#include <functional>
#include <string>
#include <thread>

#include "abbe/base/wake_up.hpp"

namespace abbe::daemon {

class ExitDeadline {
 public:
  ExitDeadline(std::chrono::nanoseconds time_limit, int exit_code, std::string message,
               std::function<std::string()> last_act = {});
  ExitDeadline(const ExitDeadline&) = delete;
  ExitDeadline& operator=(const ExitDeadline&) = delete;
  ~ExitDeadline();

 private:
  WakeUp met_;
  std::thread thread_;
};

}  // namespace abbe::daemon

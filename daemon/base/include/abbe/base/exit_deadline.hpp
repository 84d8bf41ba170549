#pragma once
/// Ends the process if its orderly shutdown hangs, for example because a thread does not return.
/// If an ExitDeadline is not destroyed within `time_limit`, the process writes `message` to stderr
/// and exits with `exit_code` without running destructors.

#include <chrono>
#include <string>
#include <thread>

#include "abbe/base/wake_up.hpp"

namespace abbe::daemon {

class ExitDeadline {
 public:
  ExitDeadline(std::chrono::nanoseconds time_limit, int exit_code, std::string message);
  ExitDeadline(const ExitDeadline&) = delete;
  ExitDeadline& operator=(const ExitDeadline&) = delete;
  ~ExitDeadline();

 private:
  WakeUp met_;
  std::thread thread_;
};

}  // namespace abbe::daemon

#pragma once
/// An orderly end waits for every thread, and a thread that hangs never ends. Unless this is
/// destroyed within `patience`, the process writes `message` to stderr and ends with `exit_code`,
/// without destructors.

#include <chrono>
#include <string>
#include <thread>

#include "abbe/base/wake_up.hpp"

namespace abbe::daemon {

class ExitDeadline {
 public:
  ExitDeadline(std::chrono::nanoseconds patience, int exit_code, std::string message);
  ExitDeadline(const ExitDeadline&) = delete;
  ExitDeadline& operator=(const ExitDeadline&) = delete;
  ~ExitDeadline();

 private:
  WakeUp met_;
  std::thread thread_;
};

}  // namespace abbe::daemon

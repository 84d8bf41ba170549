#pragma once
/// Whether somebody set the wall clock while abbed ran (a time server after a dead battery of the
/// real-time clock, or a bad server). Dates of files are not compared with such a clock. Ordinary
/// world; one thread.

#include <chrono>

namespace abbe::daemon {

struct ClockReading {
  std::chrono::nanoseconds utc{};         ///< since 1970
  std::chrono::nanoseconds since_boot{};  ///< with the time the computer slept; nobody sets it
};
[[nodiscard]] ClockReading read_clocks();

class ClockSteps {
 public:
  explicit ClockSteps(const ClockReading& start) : start_(start.utc - start.since_boot) {}

  /// Set by more than five minutes at any look until now. Stays true: files were dated in between.
  [[nodiscard]] bool look(const ClockReading& now);

 private:
  std::chrono::nanoseconds start_;
  bool stepped_ = false;
};

}  // namespace abbe::daemon

#pragma once
/// Detects that the wall clock was set while abbed ran, for example by a time server after the
/// battery of the real-time clock failed. Files then have wrong dates, from which their age must
/// not be computed. Not for real-time threads; one thread.

#include <chrono>

namespace abbe::daemon {

struct ClockReading {
  std::chrono::nanoseconds utc{};         ///< since 1970
  std::chrono::nanoseconds since_boot{};  ///< CLOCK_BOOTTIME: includes suspend; cannot be set
};
[[nodiscard]] ClockReading read_clocks();

class ClockSteps {
 public:
  explicit ClockSteps(const ClockReading& start) : start_(start.utc - start.since_boot) {}

  /// True if, at this call or an earlier one, the wall clock (`utc`) differed by more than five
  /// minutes from where it would be without having been set: from its value at construction plus
  /// the advance of `since_boot`. Stays true when the wall clock is corrected later, because files
  /// got wrong dates in between.
  [[nodiscard]] bool look(const ClockReading& now);

 private:
  std::chrono::nanoseconds start_;
  bool stepped_ = false;
};

}  // namespace abbe::daemon

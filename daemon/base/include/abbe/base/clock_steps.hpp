#pragma once
/// Detects that the wall clock was set while a process ran, for example by a time server after the
/// battery of the real-time clock failed, and that the computer was suspended. Dates before and
/// after then do not fit together. Not for real-time threads.

#include <chrono>
#include <string>
#include <vector>

namespace abbe::daemon {

struct ClockReading {
  std::chrono::nanoseconds utc{};         ///< since 1970
  std::chrono::nanoseconds since_boot{};  ///< CLOCK_BOOTTIME: includes suspend; cannot be set
  std::chrono::nanoseconds running{};     ///< CLOCK_MONOTONIC: without suspend
};
[[nodiscard]] ClockReading read_clocks();

/// What happened to the clocks between two readings.
struct ClockChange {
  /// The wall clock was set forward by this; negative: backward. A time server that only slews it
  /// also slews the other clocks.
  std::chrono::nanoseconds step{};
  std::chrono::nanoseconds suspended{};  ///< how long the computer was suspended
};
[[nodiscard]] ClockChange change_between(const ClockReading& start, const ClockReading& now);

/// Smaller changes are not reported: a leap second, a correction by a time server, and the time
/// between the readings of two clocks are no reason to doubt a date.
inline constexpr std::chrono::seconds kLeastClockChange{2};

/// Sentences without full stop: "the wall clock was set forward by 200 d 3 h". `since`: "abbed
/// started". Empty: nothing happened.
[[nodiscard]] std::vector<std::string> in_words(const ClockChange& change,
                                                const std::string& since);

class ClockSteps {
 public:
  explicit ClockSteps(const ClockReading& start) : start_(start) {}

  /// True if, at this call or an earlier one, the wall clock (`utc`) differed by more than five
  /// minutes from where it would be without having been set: from its value at construction plus
  /// the advance of `since_boot`. Stays true when the wall clock is corrected later, because files
  /// got wrong dates in between. One thread.
  [[nodiscard]] bool look(const ClockReading& now);

 private:
  ClockReading start_;
  bool stepped_ = false;
};

}  // namespace abbe::daemon

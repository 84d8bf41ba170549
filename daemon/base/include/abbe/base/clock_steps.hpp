#pragma once
/// Detects that the wall clock was set, or that the computer was suspended, while a process ran. A
/// time server may set the clock, for example after the battery of the real-time clock failed.
/// Dates that were read before and after such a step do not fit together. Not for real-time
/// threads.

#include <chrono>
#include <string>
#include <vector>

namespace abbe::daemon {

struct ClockReading {
  std::chrono::nanoseconds utc{};         ///< time since 1970
  std::chrono::nanoseconds since_boot{};  ///< CLOCK_BOOTTIME: includes suspend; cannot be set
  std::chrono::nanoseconds running{};     ///< CLOCK_MONOTONIC: without suspend
};
[[nodiscard]] ClockReading read_clocks();

/// What happened to the clocks between two readings.
struct ClockChange {
  /// The wall clock was set forward by this; negative: backward. A time server that only slews it
  /// also slews the other clocks.
  std::chrono::nanoseconds step{};
  std::chrono::nanoseconds suspended{};  ///< time for which the computer was suspended
};
[[nodiscard]] ClockChange change_between(const ClockReading& start, const ClockReading& now);

/// Changes smaller than this are not reported. They may come from a leap second, from a correction
/// by a time server, or from the time between reading the two clocks.
inline constexpr std::chrono::seconds kLeastClockChange{2};

/// The change as sentences without full stop, for example "the wall clock was set forward by 200 d
/// 3 h". `since` is the start of the time considered, for example "abbed started". Empty: the
/// clocks were not changed.
[[nodiscard]] std::vector<std::string> in_words(const ClockChange& change,
                                                const std::string& since);

class ClockSteps {
 public:
  explicit ClockSteps(const ClockReading& start) : start_(start) {}

  /// Compares `utc` with its expected value: `utc` at construction plus the advance of
  /// `since_boot`. Returns true if the difference exceeded five minutes at this call or at an
  /// earlier one. The result stays true when the wall clock is corrected later, because files got
  /// wrong dates in between. One thread.
  [[nodiscard]] bool look(const ClockReading& now);

 private:
  ClockReading start_;
  bool stepped_ = false;
};

}  // namespace abbe::daemon

#pragma once
/// A value that follows another one at a limited rate, so that what is corrected with it never
/// jumps. Exact between the instants at which the followed value changes. Pure; any thread.

#include <chrono>
#include <limits>

namespace abbe::calib {

/// The following value at the instant `at`. NaN: it follows nothing yet.
struct FollowedValue {
  double value = std::numeric_limits<double>::quiet_NaN();
  std::chrono::nanoseconds at{};
};

/// `from` moved towards `to` by at most `most`.
[[nodiscard]] double moved_towards(double from, double to, double most) noexcept;

/// The following value at the instant `at` >= from.at, if `target` has been followed since from.at
/// at a rate of at most `most_per_s`. Starts at `target` if `from` follows nothing; NaN if `target`
/// is NaN.
[[nodiscard]] double followed_value(const FollowedValue& from, double target,
                                    std::chrono::nanoseconds at, double most_per_s) noexcept;

}  // namespace abbe::calib

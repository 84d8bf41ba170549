#pragma once
/// A value that follows another value at a limited rate. A correction that is computed with it
/// never jumps. The result is exact if the followed value is constant between the calls. Pure; any
/// thread.

#include <chrono>
#include <limits>

namespace abbe::calib {

/// The following value at the instant `at`. NaN: it has not yet started to follow.
struct FollowedValue {
  double value = std::numeric_limits<double>::quiet_NaN();
  std::chrono::nanoseconds at{};
};

/// Returns `from`, moved towards `to` by at most `most`.
[[nodiscard]] double moved_towards(double from, double to, double most) noexcept;

/// The following value at the instant `at` >= from.at, after it has followed `target` since from.at
/// at a rate of at most `most_per_s`. Returns `target` if from.value is NaN, and NaN if `target` is
/// NaN.
[[nodiscard]] double followed_value(const FollowedValue& from, double target,
                                    std::chrono::nanoseconds at, double most_per_s) noexcept;

}  // namespace abbe::calib

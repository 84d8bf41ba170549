#pragma once

#include <cstddef>
#include <cstdint>

namespace abbe::daemon {

// The number of linear axes, X, Y and Z. They are the first axes of a machine description and of
// every sample.
inline constexpr std::size_t kLinearAxes = 3;

/// True if the sample has a position for each of X, Y and Z. Sample: any type with axis_count and
/// missing_mask.
template <class Sample>
[[nodiscard]] bool has_linear_axes(const Sample& sample) noexcept {
  constexpr std::uint8_t kXyz = (1u << kLinearAxes) - 1u;
  return sample.axis_count >= kLinearAxes && (sample.missing_mask & kXyz) == 0;
}

}  // namespace abbe::daemon

#pragma once
/// Where the axes were at an instant, from the samples around it. Pure functions; no allocation;
/// any thread. Position: cubic through the two enclosing samples, with slopes from their neighbours
/// (cubic Hermite, central differences). Exact for constant acceleration, where a straight line
/// lags by a T^2 / 8 = 0.6 um (5 m/s^2, 1 kHz) through the whole of every ramp. Straight line where
/// a neighbour is missing or more than 1.2 times as far as the two enclosing samples are apart.
/// Velocity is the derivative. Uncertainty: |acceleration| <= a_max is all that is assumed. The
/// error of the line is at most (a_max / 2) theta (1 - theta) T^2, in the middle (a_max / 2)
/// (T / 2)^2; of the cubic at most 6/5 of that (the integral of the modulus of its Peano kernel).
/// Taken as rectangular ([GUM] 4.3.7). Added in quadrature: speed times the time uncertainty of the
/// samples and of the instant asked for.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tl/expected.hpp>

#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

struct InterpolationOptions {
  /// Further apart than this, the samples around the instant say nothing about it. 2.5 cycles of
  /// 1 kHz: one may be lost.
  std::chrono::nanoseconds max_span = std::chrono::microseconds{2500};
  /// Bound of each axis' acceleration, m/s^2 or rad/s^2. 5: a brisk machining centre.
  std::array<double, protocol::kMaxAxes> max_acceleration = {5, 5, 5, 5, 5, 5, 5, 5};
};

enum class InterpolationError {
  TooEarly,  ///< the first sample is later than the instant
  TooLate,   ///< no sample is later than the instant: ask again when more have come
  Gap,       ///< the enclosing samples are further apart than max_span
};

/// The axes at `time`; arrays beyond `axis_count` are zero.
struct AxesAt {
  protocol::HostTime time{};
  std::uint8_t axis_count = 0;
  /// bit i: axis i is not known in an enclosing sample; its values are stale
  std::uint8_t missing_mask = 0;
  protocol::SampleFlags flags = 0;                      ///< of the two enclosing samples together
  std::array<double, protocol::kMaxAxes> position{};    ///< m or rad
  std::array<double, protocol::kMaxAxes> velocity{};    ///< m/s or rad/s
  std::array<double, protocol::kMaxAxes> u_position{};  ///< standard uncertainty, m or rad
};

/// `samples`: in order of time, no two at the same instant. `u_time`: standard uncertainty of
/// `time`.
[[nodiscard]] tl::expected<AxesAt, InterpolationError> interpolate_axes(
    std::span<const protocol::AxisSample> samples, protocol::HostTime time,
    std::chrono::nanoseconds u_time, const InterpolationOptions& options = {}) noexcept;

/// The axes at the instant of `latest`: its positions, and the slope of the line from `previous` as
/// velocity. An axis that did not answer in both, or without a `previous` that is earlier and at
/// most max_span away: velocity 0.
[[nodiscard]] AxesAt latest_axes(const protocol::AxisSample* previous,
                                 const protocol::AxisSample& latest,
                                 const InterpolationOptions& options = {}) noexcept;

}  // namespace abbe::drivers

#pragma once
/// Axis positions at an instant, interpolated between the samples around it. Pure functions; no
/// allocation; any thread.
///
/// Position: cubic through the two enclosing samples, with slopes from their neighbours (cubic
/// Hermite, central differences). It is exact for constant acceleration a. A straight line between
/// samples T apart would be wrong by
///   a T^2 / 8 = 0.6 um   (5 m/s^2, 1 kHz)
/// during the whole of every ramp. The straight line is used where a neighbour is missing or more
/// than 1.2 T away. Velocity is the derivative.
///
/// Uncertainty: the only assumption is |acceleration| <= a_max. At the fraction theta of the
/// interval T the error of the straight line is at most
///   (a_max / 2) theta (1 - theta) T^2,   in the middle (a_max / 2) (T / 2)^2.
/// The error of the cubic is at most 6/5 of the straight line's (the integral of the modulus of its
/// Peano kernel). The error is taken as rectangular ([GUM] 4.3.7). Speed times the time uncertainty
/// of the samples and of the requested instant is added in quadrature.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tl/expected.hpp>

#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

struct InterpolationOptions {
  /// Largest time between the two enclosing samples; beyond it the result is the error Gap. The
  /// default, 2.5 periods at 1 kHz, permits one lost sample.
  std::chrono::nanoseconds max_span = std::chrono::microseconds{2500};
  /// Bound of each axis' acceleration, m/s^2 or rad/s^2. 5 m/s^2 is that of a fast machining
  /// centre.
  std::array<double, protocol::kMaxAxes> max_acceleration = {5, 5, 5, 5, 5, 5, 5, 5};
};

enum class InterpolationError {
  TooEarly,  ///< the first sample is later than the instant
  TooLate,   ///< no sample is later than the instant: try again with more samples
  Gap,       ///< the enclosing samples are further apart than max_span
};

/// The axes at `time`. Elements of the arrays from `axis_count` on are zero.
struct AxesAt {
  protocol::HostTime time{};
  std::uint8_t axis_count = 0;
  /// bit i: at least one of the two enclosing samples has no value of axis i; the position and
  /// velocity of axis i are then out of date
  std::uint8_t missing_mask = 0;
  protocol::SampleFlags flags = 0;                      ///< flags of both enclosing samples
  std::array<double, protocol::kMaxAxes> position{};    ///< m or rad
  std::array<double, protocol::kMaxAxes> velocity{};    ///< m/s or rad/s
  std::array<double, protocol::kMaxAxes> u_position{};  ///< standard uncertainty, m or rad
};

/// `samples`: in order of time; two samples of the same instant are used without a slope between
/// them. `u_time`: standard uncertainty of `time`.
[[nodiscard]] tl::expected<AxesAt, InterpolationError> interpolate_axes(
    std::span<const protocol::AxisSample> samples, protocol::HostTime time,
    std::chrono::nanoseconds u_time, const InterpolationOptions& options = {}) noexcept;

/// The axes at the instant of `latest`: its positions, and as velocity the slope of the line from
/// `previous`. The velocity is 0 for an axis that did not answer in both samples, and for all axes
/// if `previous` is null, not earlier than `latest`, or more than max_span earlier.
[[nodiscard]] AxesAt latest_axes(const protocol::AxisSample* previous,
                                 const protocol::AxisSample& latest,
                                 const InterpolationOptions& options = {}) noexcept;

}  // namespace abbe::drivers

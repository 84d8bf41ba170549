#pragma once
/// One measured point out of several touches of the same place: a fast one finds the surface, after
/// backing off slow ones measure it. The slow ones must agree, and their mean is the point.
/// Ordinary world, no allocation; one thread.
///
/// Along the approach, |p1 - p2| of any two slow touches must be <= agree_sigmas times the
/// deviation of such a difference, sqrt(2) u_random. u_random: the touch's own uncertainty without
/// what all touches share (the error of the delay, v u_delay), with the probe's repeatability. The
/// mean's uncertainty: u_random / sqrt(n), or the scatter seen where that is larger, and the shared
/// part whole.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <tl/expected.hpp>

#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

struct DoubleTouchRules {
  double fast_above_m_s = 0.002;       ///< a faster touch is a find, a slower one is a measurement
  std::size_t slow_touches = 2;        ///< 2 to DoubleTouch::kMostTouches
  double same_place_m = 0.5e-3;        ///< between find and measurement, over the linear axes
  double agree_sigmas = 4.0;           ///< 3 would refuse every 370th good pair
  double u_repeatability_m = 0.25e-6;  ///< of the probe, not of the instant of its edge
  std::chrono::nanoseconds u_delay{};  ///< ProbeDelay::u_delay
  std::uint8_t linear_axes = 0b111;
};

/// The axes at contact, m or rad.
struct MeasuredTouch {
  std::uint32_t touch = 0;  ///< number of the last one
  std::uint32_t probe = 0;
  std::size_t touches = 0;
  protocol::HostTime time{};  ///< of the last one
  std::uint8_t axis_count = 0;
  std::array<double, protocol::kMaxAxes> position{};
  std::array<double, protocol::kMaxAxes> u_position{};
  std::array<double, protocol::kMaxAxes> velocity{};  ///< mean of the approaches
  double speed_m_s = 0.0;
  double spread_m = 0.0;  ///< along the approach, largest less smallest
};

enum class TouchRejection : std::uint8_t {
  NotUsable,   ///< no position, a speed out of range or unsteady, a refusal of the machine
  NoFind,      ///< a slow touch that no fast one announced
  OtherPlace,  ///< a slow touch too far from the find
  OtherSide,   ///< a slow touch from another direction than the one before
  Disagree,    ///< the slow touches do not agree
};
[[nodiscard]] std::string_view name(TouchRejection rejection) noexcept;

class DoubleTouch {
 public:
  static constexpr std::size_t kMostTouches = 8;

  explicit DoubleTouch(const DoubleTouchRules& rules) noexcept : rules_(rules) {}

  /// A point when the last touch of one came, a rejection when it had to be given up (the next
  /// begins with a find), nothing otherwise.
  [[nodiscard]] std::optional<tl::expected<MeasuredTouch, TouchRejection>> on_touch(
      const protocol::ProbeTrigger& touch) noexcept;
  void reset() noexcept;

 private:
  using Outcome = std::optional<tl::expected<MeasuredTouch, TouchRejection>>;
  [[nodiscard]] Outcome reject(TouchRejection why) noexcept;
  [[nodiscard]] double distance_m(const protocol::ProbeTrigger& a,
                                  const protocol::ProbeTrigger& b) const noexcept;
  [[nodiscard]] double cosine(const protocol::ProbeTrigger& a,
                              const protocol::ProbeTrigger& b) const noexcept;
  [[nodiscard]] tl::expected<MeasuredTouch, TouchRejection> conclude() const noexcept;
  [[nodiscard]] double along_m(const protocol::ProbeTrigger& touch) const noexcept;
  [[nodiscard]] double u_along_m(const protocol::ProbeTrigger& touch) const noexcept;
  [[nodiscard]] double u_of_mean(std::size_t axis, double mean) const noexcept;

  DoubleTouchRules rules_;
  bool found_ = false;
  protocol::ProbeTrigger find_;
  std::array<protocol::ProbeTrigger, kMostTouches> slow_{};
  std::size_t count_ = 0;
};

}  // namespace abbe::drivers

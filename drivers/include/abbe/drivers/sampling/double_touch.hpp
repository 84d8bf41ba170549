#pragma once
/// One measured point from several touches at the same place: a fast touch finds the surface; after
/// retraction, slow touches measure it. The slow touches must agree; the point is their mean. Not
/// for the RT path, but no allocation; one thread.
///
/// Any two slow touches must agree along the approach direction. With p1 and p2 their positions:
///     |p1 - p2| <= agree_sigmas * sqrt(2) * u_random
/// sqrt(2) u_random is the standard deviation of p1 - p2. u_random is the standard uncertainty of a
/// touch including the probe's repeatability, without the part common to all touches (u_common = v
/// u_delay, with the probing speed v and the uncertainty u_delay of the probe's delay). The
/// variance of the mean of n slow touches is
///     max(u_random^2, observed variance) / n + u_common^2

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
  double fast_above_m_s = 0.002;       ///< faster touches find the surface, slower ones measure it
  std::size_t slow_touches = 2;        ///< 2 to DoubleTouch::kMostTouches
  double same_place_m = 0.5e-3;        ///< distance of fast and slow touch, over the linear axes
  double agree_sigmas = 4.0;           ///< 3 would refuse one of 370 good pairs
  double u_repeatability_m = 0.25e-6;  ///< of the probe, without that of the instant of the edge
  std::chrono::nanoseconds u_delay{};  ///< ProbeDelay::u_delay
  std::uint8_t linear_axes = 0b111;
};

/// The axes at contact, m or rad.
struct MeasuredTouch {
  std::uint32_t touch = 0;  ///< number of the last touch
  std::uint32_t probe = 0;
  std::size_t touches = 0;
  protocol::HostTime time{};  ///< of the last touch
  std::uint8_t axis_count = 0;
  std::array<double, protocol::kMaxAxes> position{};
  std::array<double, protocol::kMaxAxes> u_position{};
  std::array<double, protocol::kMaxAxes> velocity{};  ///< mean of the approaches
  double speed_m_s = 0.0;
  double spread_m = 0.0;  ///< along the approach, largest minus smallest
};

enum class TouchRejection : std::uint8_t {
  NotUsable,    ///< no position, speed out of range or not constant, or refused by the machine
  NoFastTouch,  ///< a slow touch without a fast touch before it
  OtherPlace,   ///< a slow touch too far from the fast touch
  OtherSide,    ///< a slow touch from another direction than the first slow touch
  Disagree,     ///< the slow touches do not agree
};
[[nodiscard]] std::string_view name(TouchRejection rejection) noexcept;

class DoubleTouch {
 public:
  static constexpr std::size_t kMostTouches = 8;

  explicit DoubleTouch(const DoubleTouchRules& rules) noexcept : rules_(rules) {}

  /// Returns the measured point after its last touch; a rejection if the point was abandoned (the
  /// next point begins with a fast touch); nullopt if the point needs further touches.
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

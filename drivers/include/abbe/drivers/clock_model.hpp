#pragma once
/// Converts a device's own clock to host time. The conversion is estimated from the arrival times
/// of packets. A packet arrives after the instant that it reports, by a delay >= 0. So (arrival -
/// device time) lies above a straight line (offset and skew), and close to it when the delay is
/// smallest.
/// The model is a line below all arrivals of the last minute that touches the lowest one. Its slope
/// is the mean slope of the lower convex hull of the arrivals over the middle half of the observed
/// time, limited to max_skew.
/// The smallest delay itself cannot be observed. It lies in [0, max_constant_delay]. The estimate
/// is centred in that interval, and the interval enters the uncertainty as a rectangular
/// distribution ([GUM] 4.3.7).
/// Deterministic, fixed memory, no allocation. One thread.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "abbe/drivers/device.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

struct ClockModelOptions {
  /// Time for which arrivals are kept: long enough to resolve a skew of 1 ppm, short enough to
  /// follow a skew that changes with temperature.
  std::chrono::nanoseconds window = std::chrono::seconds{60};
  /// Largest rate error of a quartz clock in a control cabinet. A larger slope is normally caused
  /// by late arrivals. If further arrivals confirm the larger slope, skew_beyond_limit() returns
  /// it, the model is never settled, and its u_time includes the discrepancy.
  double max_skew = 200e-6;
  /// Upper bound of the smallest delay (device + wire + kernel).
  std::chrono::nanoseconds max_constant_delay = std::chrono::milliseconds{2};
  /// Largest distance of an arrival from the line that a delay can explain. The device clock has
  /// jumped if an arrival is further below the line, or if arrivals are further above it for
  /// several seconds.
  std::chrono::nanoseconds jump = std::chrono::milliseconds{50};
  std::size_t settled_after = 30;  ///< observations; 10 s with a packet every 332 ms
};

/// An instant of the device clock, converted to host time. `u_time`: standard uncertainty (k = 1).
struct HostInstant {
  protocol::HostTime time{};
  std::chrono::nanoseconds u_time{};
  bool settled = false;
};

class ClockModel {
 public:
  enum class Observed {
    Followed,  ///< the model includes the observation
    /// The device clock went back or jumped: the model restarted with this observation.
    Restarted,
  };

  explicit ClockModel(const ClockModelOptions& options = {}) noexcept : options_(options) {}

  /// Adds an observation: `last_point` is the last instant that a packet reports. Call once per
  /// packet, before mapping its points with to_host().
  Observed observe(protocol::DeviceTime last_point, protocol::HostTime arrival) ABBE_RT;

  /// Host time of an instant of the device clock. Meant for instants within the window or shortly
  /// before or after it. Before the first observation the result is the epoch with an uncertainty
  /// of one hour.
  [[nodiscard]] HostInstant to_host(protocol::DeviceTime t) const ABBE_RT;

  [[nodiscard]] bool has_observations() const ABBE_RT { return count_ > 0; }
  /// True if the model maps `t` to an instant later than `arrival` by more than
  /// ClockModelOptions::jump, that is, the point would have been measured after it arrived. False
  /// before the first observation.
  [[nodiscard]] bool is_ahead(protocol::DeviceTime t, protocol::HostTime arrival) const ABBE_RT;

  /// Discards all observations and counts a restart. Call when the device clock has jumped.
  void restart() ABBE_RT;

  /// Discards all observations. Call after a reconnection: the device may be another one.
  void reset() ABBE_RT;

  [[nodiscard]] ClockStatus status() const ABBE_RT;

  /// The skew estimated from arrivals if it exceeds max_skew significantly; else 0.
  [[nodiscard]] double skew_beyond_limit() const ABBE_RT { return beyond_ ? -free_slope_ : 0.0; }

 private:
  struct Point {
    double device_s = 0.0;  ///< device time since origin_device_
    double offset_s = 0.0;  ///< (arrival - origin_host_) - device_s
  };
  /// The window is divided into slices of window / 255. The lowest arrival of each slice is kept as
  /// a point.
  static constexpr std::size_t kPoints = 256;

  void begin_with(protocol::DeviceTime last_point, protocol::HostTime arrival) ABBE_RT;
  [[nodiscard]] bool jumped(const Point& p, protocol::HostTime arrival) ABBE_RT;
  void keep(const Point& p) ABBE_RT;
  void forget_before(double device_s) ABBE_RT;
  void fit() ABBE_RT;
  void fit_slope() ABBE_RT;
  /// Writes the indices of the hull's points to hull_ and returns their number.
  std::size_t find_hull() ABBE_RT;
  [[nodiscard]] double hull_height(std::size_t hull_size, double device_s) const ABBE_RT;
  void judge_lateness() ABBE_RT;
  void judge_skew() ABBE_RT;
  [[nodiscard]] double u_touch_of_free_line() const ABBE_RT;
  [[nodiscard]] double line_at(double device_s) const ABBE_RT;
  [[nodiscard]] bool settled() const ABBE_RT;

  ClockModelOptions options_;
  protocol::DeviceTime origin_device_{};
  protocol::HostTime origin_host_{};
  std::array<Point, kPoints> points_{};
  std::array<std::uint16_t, kPoints> hull_{};  ///< scratch of fit_slope()
  std::size_t count_ = 0;
  std::uint64_t restarts_ = 0;
  double last_device_s_ = 0.0;
  double offset_s_ = 0.0;  ///< value of the line at device_s = pivot_s_
  double pivot_s_ = 0.0;
  double slope_ = 0.0;       ///< d offset / d device time
  double free_slope_ = 0.0;  ///< the slope before it is limited to max_skew
  double u_beyond_s_ = 0.0;  ///< excess of the free slope times the window; 0 unless beyond_
  bool beyond_ = false;      ///< the free slope exceeds max_skew significantly
  // Device times, s, at one quarter and at three quarters of the observed span. free_slope_ is the
  // slope, between these two times, of the lower convex hull of the arrivals.
  double quarter_s_ = 0.0;
  double three_quarters_s_ = 0.0;

  double median_lateness_s_ = 0.0;
  double lowered_s_ = 0.0;  ///< estimated height of the line above the true envelope
  double u_touch_s_ = 0.0;  ///< standard uncertainty of the line at the point it touches
  double u_slope_ = 0.0;
  bool late_ = false;  ///< since late_since_ every arrival is more than `jump` above the line
  protocol::HostTime late_since_{};
};

}  // namespace abbe::drivers

#pragma once
/// From a device's own clock to host time, learned from arrivals. An arrival is never early: it
/// comes after the instant it reports by a delay >= 0, so (arrival - device time) lies above a
/// straight line (offset and skew) and comes near it when the delay is smallest. The model is a
/// line below all arrivals of the last minute that touches the lowest; its slope is that of their
/// lower convex hull, held within a bound. The smallest delay itself cannot be seen; it is
/// somewhere in [0, max_constant_delay]. The estimate is centred in that interval, which enters the
/// uncertainty as a rectangular distribution ([GUM] 4.3.7). Deterministic, fixed memory, no
/// allocation. One thread.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "abbe/drivers/device.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

struct ClockModelOptions {
  std::chrono::nanoseconds window = std::chrono::seconds{
      60};  ///< long enough for a skew of 1 ppm, short enough to follow temperature
  /// Quartz in a cabinet: beyond it a slope is an artefact of late arrivals. If more arrivals
  /// confirm it, the clock is reported (skew_beyond_limit()), never settled, and its u_time holds
  /// the disagreement.
  double max_skew = 200e-6;
  /// bound of the smallest delay (device + wire + kernel)
  std::chrono::nanoseconds max_constant_delay = std::chrono::milliseconds{2};
  /// a disagreement no delay explains: the device clock jumped
  std::chrono::nanoseconds jump = std::chrono::milliseconds{50};
  std::size_t settled_after = 30;  ///< observations; with packets every 332 ms this is 10 s
};

/// An instant of the device in host time. `u_time` is a standard uncertainty (k = 1).
struct HostInstant {
  protocol::HostTime time{};
  std::chrono::nanoseconds u_time{};
  bool settled = false;
};

class ClockModel {
 public:
  enum class Observed {
    Followed,  ///< the model took it in
    /// the device clock went back or jumped: the model began anew with this observation
    Restarted,
  };

  explicit ClockModel(const ClockModelOptions& options = {}) noexcept : options_(options) {}

  /// The last instant a packet reports, and when the packet arrived. Call once per packet, before
  /// mapping its points.
  Observed observe(protocol::DeviceTime last_point, protocol::HostTime arrival) ABBE_RT;

  /// Host time of any instant of the device; meant for the window and shortly around it. Before the
  /// first observation the answer is the epoch with an uncertainty of an hour.
  [[nodiscard]] HostInstant to_host(protocol::DeviceTime t) const ABBE_RT;

  /// Forget everything: reconnected to what may be another device.
  void reset() ABBE_RT;

  [[nodiscard]] ClockStatus status() const ABBE_RT;

  /// The rate that arrivals show, when it is beyond max_skew and not by chance; else 0.
  [[nodiscard]] double skew_beyond_limit() const ABBE_RT { return beyond_ ? -free_slope_ : 0.0; }

 private:
  struct Point {
    double device_s = 0.0;  ///< device time since origin_device_
    double offset_s = 0.0;  ///< (arrival - origin_host_) - device_s
  };
  /// one per window / 255: the lowest arrival of its slice
  static constexpr std::size_t kPoints = 256;

  void begin_with(protocol::DeviceTime last_point, protocol::HostTime arrival) ABBE_RT;
  [[nodiscard]] bool jumped(const Point& p, protocol::HostTime arrival) ABBE_RT;
  void keep(const Point& p) ABBE_RT;
  void forget_before(double device_s) ABBE_RT;
  void fit() ABBE_RT;
  void fit_slope() ABBE_RT;
  /// Indices of the hull's points go to hull_; returns how many.
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
  double offset_s_ = 0.0;  ///< of the line at device_s = pivot_s_
  double pivot_s_ = 0.0;
  double slope_ = 0.0;       ///< d offset / d device time
  double free_slope_ = 0.0;  ///< before it was held within the bound
  double u_beyond_s_ = 0.0;  ///< what the free slope adds over the window; 0 unless beyond_
  bool beyond_ = false;      ///< the free slope is beyond the bound, and not by chance
  double quarter_s_ = 0.0;   ///< of the observed device time: the slope is that between here ...
  double three_quarters_s_ = 0.0;  ///< ... and here
  double median_lateness_s_ = 0.0;
  double lowered_s_ = 0.0;  ///< what the line is taken to lie above the true envelope
  double u_touch_s_ = 0.0;  ///< standard uncertainty of the line where it touches
  double u_slope_ = 0.0;
  bool late_ = false;  ///< arrivals are later than any delay explains, since late_since_
  protocol::HostTime late_since_{};
};

}  // namespace abbe::drivers

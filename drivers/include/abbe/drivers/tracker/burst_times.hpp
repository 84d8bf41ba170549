#pragma once
/// The times of points that arrive in bursts with the time of their sender: judges each time, keeps
/// the clock model, converts to host time, and marks gaps, jumps of the clock and the first point
/// after an interruption. Every receiver of tracker points and of lines uses it. Deterministic,
/// fixed memory, real time. One thread.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/drivers/clock_model.hpp"
#include "abbe/drivers/device_time_check.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

/// The time of a sample that has no member for the time of its sender.
struct TimedHead {
  protocol::SampleHead head;
  protocol::DeviceTime device_time{};
};

/// Counts since construction.
struct BurstTimeCounters {
  std::uint64_t gaps = 0;  ///< gaps in the points that were not caused by a lost beam
  std::uint64_t beam_losses = 0;
  std::uint64_t time_disorder = 0;  ///< points whose time does not fit; not used
  std::uint64_t time_jumps = 0;     ///< new time bases of the sender's clock
};

/// `Point`: TrackerPoint or TimedHead.
template <class Point>
class BurstTimesOf {
 public:
  /// Largest number of points of one burst.
  static constexpr std::size_t kMostPoints = 4096;

  /// `time_separation`: interval between two points; a longer gap is marked GapBefore. 0: the
  /// points have no fixed interval, or it is not known; gaps are not detected.
  BurstTimesOf(const ClockModelOptions& clock, std::chrono::nanoseconds time_separation) noexcept
      : clock_options_(clock), separation_(time_separation), clock_(clock) {}

  /// Sets time, u_time and the flags of time of points that arrived at `arrival` and have their
  /// device_time; other flags remain. At most kMostPoints.
  void assign(std::span<Point> points, protocol::HostTime arrival) ABBE_RT;
  /// The same for a point without a device time that is the mean over [arrival - delay - duration,
  /// arrival - delay], 0 <= delay <= max_constant_delay. Its time is the middle of this interval;
  /// delay and duration each contribute a rectangular distribution ([GUM] 4.3.7).
  void assign_mean(Point& point, std::chrono::nanoseconds duration,
                   protocol::HostTime arrival) ABBE_RT;

  /// Call it for a new connection: the device may have another clock, so the next point is marked
  /// Restarted.
  void connection_began() ABBE_RT;
  /// Call it when data is missing: the next point is marked GapBefore.
  void data_lost() ABBE_RT { pending_flags_ |= protocol::SampleFlag::GapBefore; }
  /// Call it when the beam is lost: the next point after the gap is marked BeamReturned. Repeated
  /// calls count once.
  void beam_lost() ABBE_RT;

  using Counters = BurstTimeCounters;
  [[nodiscard]] const Counters& counters() const ABBE_RT { return counters_; }
  [[nodiscard]] ClockStatus clock() const ABBE_RT { return clock_.status(); }
  [[nodiscard]] double skew_beyond_limit() const ABBE_RT { return clock_.skew_beyond_limit(); }

 private:
  using Verdict = DeviceTimeCheck::Verdict;
  using Points = std::span<Point>;

  [[nodiscard]] bool is_ahead(protocol::DeviceTime t) const ABBE_RT;
  [[nodiscard]] std::size_t judge(Points points, std::size_t first) ABBE_RT;
  void convert(Points points, std::size_t first, std::size_t end) ABBE_RT;
  void begin_time_base() ABBE_RT;
  void set_time(Point& point) const ABBE_RT;
  void refuse(Point& point) ABBE_RT;
  void follow(Point& point) ABBE_RT;
  void mark_hole(std::chrono::nanoseconds since_last, Point& point) ABBE_RT;
  void mark_pending(protocol::SampleHead& head) ABBE_RT;

  ClockModelOptions clock_options_;
  std::chrono::nanoseconds separation_;
  ClockModel clock_;
  DeviceTimeCheck times_;
  Counters counters_;
  protocol::HostTime arrival_{};
  bool beam_lost_ = false;
  protocol::SampleFlags pending_flags_ = 0;  ///< for the next point
  /// device time of the last point with a time that fits
  std::optional<protocol::DeviceTime> last_;
  std::array<Verdict, kMostPoints> verdicts_{};
};

using BurstTimes = BurstTimesOf<protocol::TrackerPoint>;

}  // namespace abbe::drivers

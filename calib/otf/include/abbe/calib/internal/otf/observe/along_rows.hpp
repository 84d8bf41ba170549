#pragma once
/// The component along the direction of travel, from scale readings recorded in addition to the
/// tracker's points. A segment that was measured at constant speed gives a third row:
///     y = a1 . (p - q(t_m)),   sigma^2 = sigma_1^2 / n + (v sigma_t)^2 f
/// a1: direction of travel of the target, p: measured point in the machine, target offset
/// subtracted, q: scale readings at the machine's time t_m of the segment (RunClock), n: samples in
/// the segment, sigma_1: standard uncertainty of a sample along a1 ([Sanders 2023] eq. (4) with
/// a1), v: speed, sigma_t: EncoderLog::sigma_time_s, f: see EncoderLine::variance. The design of
/// the row is that of a2 and a3, along a1. Corrections of offset and drift of the clocks are two
/// more unknowns, with the columns v and v (t - origin), unless the clocks are known.
///
/// Two kinds of outliers are left out and named in the notes: readings that jump away from their
/// neighbours and back, and rows of up to three consecutive segments that deviate by seven standard
/// deviations.
///
/// q is taken from a straight line through the readings within the time of the segment, so that the
/// average of the readings is compared with the average of the samples.

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/otf/observe/observe.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "abbe/calib/otf/run/encoder_log.hpp"

namespace abbe::calib::otf {

/// Straight line through the readings of a time window.
struct EncoderLine {
  Vector3 q_m = Vector3::Zero();  ///< readings at the requested time
  Vector3 v_m_s = Vector3::Zero();
  /// Variance of q along the travel, relative to (v sigma_t)^2: 1/m + (t - mean)^2 / S for m
  /// readings.
  double variance = 1.0;
  double variance_of_v = 0.0;  ///< variance of v_m_s, relative to (v sigma_t)^2, in 1/s^2
};

/// A ClockMap whose times are relative to the first time of each clock. A double holds the time of
/// day since 1970 in steps of 0.24 us. Sums with such a time lose the digits that an adjustment of
/// the clocks needs; differences of two such times do not.
struct RunClock {
  double lag_s = 0.0;        ///< machine's clock at `origin_s`, since `log_start_s`
  double drift = 0.0;        ///< relative drift, as ClockMap::drift
  double origin_s = 0.0;     ///< time of the tracker's clock
  double log_start_s = 0.0;  ///< time of the machine's clock at the first reading

  [[nodiscard]] static RunClock of(const ClockMap& map, double origin_s, double log_start_s) {
    return {map.offset_s + (origin_s - log_start_s) + map.drift * (origin_s - map.origin_s),
            map.drift, origin_s, log_start_s};
  }
  [[nodiscard]] ClockMap map() const { return {lag_s + (log_start_s - origin_s), drift, origin_s}; }
  /// Time of the machine's clock since the first reading.
  [[nodiscard]] double since_start_s(double tracker_s) const {
    const double since_origin_s = tracker_s - origin_s;
    return since_origin_s + lag_s + drift * since_origin_s;
  }
};

/// Readings in the order of time. Times are relative to the first reading.
class EncoderLines {
 public:
  explicit EncoderLines(std::span<const EncoderReading>);

  [[nodiscard]] double period_s() const { return period_s_; }  ///< median period of the readings
  [[nodiscard]] std::span<const EncoderReading> readings() const { return readings_; }
  /// time of the first reading, machine's clock
  [[nodiscard]] double log_start_s() const { return log_start_s_; }
  /// The line at `at_s` from the readings between `from_s` and `to_s`. If there are fewer than two,
  /// the line through the readings before and after `at_s`. nullopt if half of the readings are
  /// missing.
  [[nodiscard]] std::optional<EncoderLine> line(double from_s, double at_s, double to_s) const;

 private:
  [[nodiscard]] std::optional<EncoderLine> between_two(double at_s) const;

  std::vector<EncoderReading> readings_;
  double log_start_s_ = 0.0, period_s_ = 0.0;
};

/// Adds the rows along the direction of travel to observations across it, and corrects the clock.
/// The log must outlive this object.
class AlongRows {
 public:
  /// `clock`: that of the log if it is known, otherwise a first estimate.
  AlongRows(const EncoderLog& log, const RunClock& clock);

  /// The observations with the rows of `across` and a third row for each segment at constant speed.
  [[nodiscard]] Observations added_to(const Observations& across, const SegmentSeries&,
                                      const Noise&) const;
  [[nodiscard]] std::size_t clock_unknowns() const {
    return log_->known_clock ? 0 : kClockUnknowns;
  }
  [[nodiscard]] const RunClock& clock() const { return clock_; }
  /// Adds the correction of offset and drift that an adjustment estimated; an empty vector changes
  /// nothing.
  void correct_clock(const Eigen::VectorXd& by);
  /// Factor of the standard uncertainties of the rows.
  [[nodiscard]] double sigma_factor() const { return sigma_factor_; }
  void multiply_sigma(double factor) { sigma_factor_ *= factor; }
  /// Excludes these segments: added_to() makes no row for them any more.
  void leave_out(std::span<const std::size_t> segments);
  [[nodiscard]] const std::vector<std::size_t>& left_out() const { return left_out_; }

 private:
  const EncoderLog* log_;
  EncoderLines lines_;
  RunClock clock_;
  double sigma_factor_ = 1.0;
  std::vector<std::size_t> left_out_;  ///< indices of segments, ascending
};

}  // namespace abbe::calib::otf

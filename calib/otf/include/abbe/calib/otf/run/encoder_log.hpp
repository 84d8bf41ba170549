#pragma once
/// Scale readings of a run, with times of the machine's clock, and the relation of this clock to
/// that of the tracker:
///     t_machine = t + offset + drift (t - origin)
/// t: time of the tracker. The times of the readings have white, Gaussian errors.

#include <optional>
#include <vector>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::otf {

struct EncoderReading {
  /// Time of the machine's clock, strictly ascending. The origin is arbitrary, because only
  /// differences are used. Times since 1970 are rounded to multiples of 0.24 us.
  double time_s = 0.0;
  Vector3 q_m = Vector3::Zero();  ///< scale readings of X, Y, Z: axis position
};

struct ClockMap {
  double offset_s = 0.0;  ///< machine's clock minus tracker's clock at `origin_s`
  double drift = 0.0;     ///< relative; 1e-6: the machine's clock is fast by 1 us per second
  double origin_s = 0.0;  ///< time of the tracker's clock

  [[nodiscard]] double machine_s(double tracker_s) const {
    return tracker_s + offset_s + drift * (tracker_s - origin_s);
  }
};

struct EncoderLog {
  std::vector<EncoderReading> readings;
  /// Standard uncertainty of the time of one reading relative to the tracker's times, without
  /// offset and drift of the clocks. 20 us is usual for readings that a fieldbus cycle stamps; a
  /// trigger line that latches both needs about 10 us or less.
  double sigma_time_s = 20e-6;
  /// Relation of the clocks if it is known: a trigger line, or one clock for both. Absent: it is
  /// estimated.
  std::optional<ClockMap> known_clock{};
};

/// Checks the log. BadInput: fewer than 2 readings, times do not ascend, sigma_time_s not positive.
/// NotFinite: a time or a reading. The text gives the index of the reading.
[[nodiscard]] Result<void> check(const EncoderLog&);

}  // namespace abbe::calib::otf

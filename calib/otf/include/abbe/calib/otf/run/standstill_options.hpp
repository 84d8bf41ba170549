#pragma once
/// Options of standstill mode: criteria for a standstill, and repeatability of the position of a
/// standing machine.

namespace abbe::calib::otf {

struct StandstillOptions {
  /// Length of the two windows whose means give the speed at a sample. 0.05 s contains 1.5 periods
  /// of a vibration of 30 Hz. At least two samples.
  double window_s = 0.05;
  /// The target stands still below this speed, or below four times the noise of the speed if that
  /// is larger. A vibration of 5 um at 30 Hz gives 0.04 mm/s, a machine that accelerates with 1
  /// m/s^2 exceeds 0.2 mm/s after 14 ms.
  double stand_speed_m_per_s = 0.2e-3;
  /// Shortest standstill, from its first to its last sample. These samples may be up to one window
  /// away from the motion, so that a stop of 0.2 s is long enough.
  double least_duration_s = 0.1;
  /// Time after the arrival, while the machine settles. Its samples are left out of the mean if the
  /// standstill is at least three times as long.
  double settle_s = 0.1;
  /// A standstill ends if there is no valid sample for longer than this. After a shorter break it
  /// continues if the target is at the same place.
  double longest_break_s = 2.0;
  /// Largest creep from the first to the last sample of a standstill. A larger creep is motion.
  double most_creep_m = 100e-6;
  /// Largest fraction of the positions without a standstill, and of the standstills that belong to
  /// no position.
  double most_unmatched = 0.1;
  /// Standard uncertainty of each component of the position of the machine in one standstill:
  /// repeatability of positioning, and air that does not average out in one standstill. The
  /// uncertainty of a mean is not smaller than this, however many samples it has.
  double u_repeatability_m = 0.5e-6;
};

}  // namespace abbe::calib::otf

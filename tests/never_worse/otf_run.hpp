#pragma once
/// A random machine, its on-the-fly run, and typical faults of a shop floor; then the verdict of
/// the gate, and the error of the model against the truth. Deterministic from the seed. Each run is
/// computed on one thread.

#include <functional>
#include <random>
#include <string>
#include <vector>

#include "abbe/calib/otf/judge/judge.hpp"
#include "abbe/sim/path_motion.hpp"
#include "abbe/sim/truth_machine.hpp"
#include "campaign.hpp"
#include "stream_faults.hpp"

namespace abbe::tests::never_worse {

using calib::Vector3;

/// The true machine, and what the configuration states about it; a fault changes the truth or the
/// configuration.
struct OtfRun {
  // the truth
  sim::TruthMachine truth;
  std::vector<Vector3> driven_m;  ///< vertices, scale readings
  calib::RigidTransform T_machine_tracker;
  /// Error of the machine at a scale reading that no error motion of `truth` contains; may be
  /// empty.
  std::function<Vector3(const Vector3& q_m)> more_error_m;
  /// displacement of the target in the machine; may be empty
  std::function<calib::RigidTransform(double time_share)> moved;
  /// true travel per reading, due to the temperature of the scales
  Vector3 scale = Vector3::Ones();
  double range_scale = 1.0, range_offset_m = 0.0;
  double sigma_range_m = 2e-6, sigma_angle_rad = 3e-6;
  double correlation_s = 0.0;  ///< correlation time of the noise; 0: white
  /// Second noise of the readings, beside the first and correlated over slow_s.
  double slow_range_m = 0.0, slow_angle_rad = 0.0, slow_s = 0.0;
  double lost_from = 0.0, lost_to = 0.0;  ///< share of the run without a beam
  double spikes = 0.0;                    ///< share of the samples with an error of 0.2 mm
  double feed_m_per_s = 5.0 / 60.0, rate_hz = 100.0;
  double dwell_s = 0.05;                          ///< before each leg
  double vibration_m = 0.0, vibration_hz = 30.0;  ///< amplitude, in a random direction
  double breaks_per_s = 0.0, break_s = 0.3;       ///< beam breaks at random times
  /// Changes the tracker's stream; may be empty.
  std::function<void(otf::Stream&, std::mt19937_64&)> disturb;
  // the configuration
  calib::otf::Mode mode = calib::otf::Mode::OnTheFly;
  double u_repeatability_m = 0.0;  ///< of standstill mode
  calib::otf::Machine machine;
  std::vector<Vector3> path_m;
  calib::otf::Noise noise;
  calib::otf::OrientationEvidence evidence;
  calib::otf::Estimator estimator = calib::otf::Options{}.estimator;
  std::mt19937_64 random;
};

[[nodiscard]] std::vector<Fault<OtfRun>> otf_faults();

/// Half the length of each axis is between `least_cells` and `most_cells` distances of 50 mm.
[[nodiscard]] OtfRun random_otf_run(std::uint64_t seed, double least_cells = 4.0,
                                    double most_cells = 8.0);
/// The tracker stands elsewhere; the errors of its ranges and of the scales are drawn again with
/// their stated uncertainties.
void set_up_again(OtfRun&);

/// Adds a line through the reference (straightness: a parabola) to a true table, `by` where it is
/// largest; "EC0Y": to this squareness.
void move_table(OtfRun&, const std::string& table, double by);

/// V of the machine at a scale reading, at the middle of the run.
[[nodiscard]] Vector3 true_error_m(const OtfRun&, const Vector3& q_m);

/// The tracker's samples of the run. Draws from run.random.
[[nodiscard]] std::vector<calib::otf::TrackerObservation> measure(OtfRun& run);

[[nodiscard]] Outcome identify_and_compare(OtfRun run);

/// The same machine with standstills of one second at 200 positions, 10 m/min between them.
[[nodiscard]] OtfRun random_standstill_run(std::uint64_t seed);
[[nodiscard]] std::vector<Fault<OtfRun>> standstill_faults();

}  // namespace abbe::tests::never_worse

#pragma once
/// A random machine, its on-the-fly run, and the faults that happen to one on a shop floor; then what the
/// gate says of it and what the model is worth against the truth. Deterministic from the seed. One thread
/// each.

#include <functional>
#include <random>
#include <string>
#include <vector>

#include "abbe/calib/otf/judge.hpp"
#include "abbe/sim/path_motion.hpp"
#include "abbe/sim/truth_machine.hpp"

namespace abbe::tests::never_worse {

using calib::Vector3;

/// What the machine is and what is known of it; a fault changes one or the other.
struct OtfRun {
  // the world
  sim::TruthMachine truth;
  std::vector<Vector3> driven_m;  ///< vertices, scale readings
  calib::RigidTransform T_machine_tracker;
  std::function<calib::RigidTransform(double time_share)>
      moved;                        ///< of the target in the machine; may be empty
  Vector3 scale = Vector3::Ones();  ///< true travel per reading: temperature of the scales
  double range_scale = 1.0, range_offset_m = 0.0;
  double sigma_range_m = 2e-6, sigma_angle_rad = 3e-6;
  double correlation_s = 0.0;             ///< of the noise; 0: white
  double lost_from = 0.0, lost_to = 0.0;  ///< share of the run without a beam
  double spikes = 0.0;                    ///< share of the samples that are off by 0.2 mm
  double feed_m_per_s = 5.0 / 60.0, rate_hz = 100.0;
  // what is configured
  calib::otf::Machine machine;
  std::vector<Vector3> path_m;
  calib::otf::Noise noise;
  calib::otf::OrientationEvidence evidence;
  std::mt19937_64 random;
};

struct Fault {
  std::string name;
  std::function<void(OtfRun&)> put_in;
  std::vector<std::string> causes;  ///< one of them stands in the first reason of a refusal
  bool visible = true;              ///< false: nothing that is known contradicts it
};
[[nodiscard]] std::vector<Fault> otf_faults();

[[nodiscard]] OtfRun random_otf_run(std::uint64_t seed);

struct Outcome {
  bool accepted = false;
  std::string first_reason;
  double before_m = 0.0;  ///< mean |V| of the truth, without rigid motion
  double left_m = 0.0;    ///< mean |V of the model - V|, without rigid motion
  double u_m = 0.0;       ///< mean stated standard uncertainty: root of the trace
  double sigma0 = 0.0;
  std::size_t covered = 0, intervals = 0;  ///< components of V inside their 95 % interval
};
[[nodiscard]] Outcome identify_and_compare(OtfRun run);

}  // namespace abbe::tests::never_worse

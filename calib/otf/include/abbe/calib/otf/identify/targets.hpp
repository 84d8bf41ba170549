#pragma once
/// Identification of all 18 tables from several runs in one adjustment, each with the reflector at
/// another offset from the tool reference point. A single run cannot separate some rotations from
/// translations, because both displace its only target in the same way. Three targets that are not
/// on a line determine these rotations, and the model is then valid for any tool. The tracker may
/// be set up again between the runs: every run is aligned by itself and has six rigid unknowns of
/// its own,
///     y_k = A_k (U, T_k, r_k) + noise,   k = 1 .. number of runs
/// so that an unknown constant error of a target offset has no effect. The information of the runs
/// is added (estimation/information.hpp) and solved with the 24 conditions of datum G2 for 18
/// tables. With Estimator::Simultaneous each run is linearised again at the common solution
/// (simultaneous.hpp).
///
/// With Options::nests each run has its own drift of the tracker, estimated from its visits and the
/// rows of all runs (tracker_drift.hpp). The nests must be at the same places in the tracker frame
/// in all runs: the tracker must not be set up again between runs with visits.
///
/// Each run has its own offset of the ranges, with the prior of Noise, because between the runs the
/// reflector is moved and the tracker is often homed again. The offsets count as independent. The
/// scale of the ranges and the scales of the axes are those of Noise, common to all runs. The noise
/// of the residuals is treated as in solve(): correlated noise widens the covariance (it is not
/// prewhitened). The factor of the covariance is that of all residuals together, or that of one run
/// if this is larger.

#include <span>
#include <vector>

#include "abbe/calib/otf/judge/judge.hpp"

namespace abbe::calib::otf {

struct TargetRun {
  std::span<const TrackerObservation> samples;
  Path path;
  Vector3 target_offset_m = Vector3::Zero();
};

struct TargetsIdentification {
  std::vector<Observations> observations;  ///< one per run, with 18 tables
  /// One solution per run. All have the same model. Rigid unknowns, pose, range offset, residuals
  /// and statistics are those of the run. Adjustment and covariance are those of all runs together,
  /// for the unknowns of this run.
  std::vector<Solution> solutions;
  Statistics statistics;  ///< statistics of all runs together

  [[nodiscard]] const VolumetricModel& model() const { return solutions.front().model; }
};

/// Identifies all 18 tables. `machine.target_offset_m` is not used. DegenerateGeometry if the
/// offsets are on a line within 0.5 mm; BadInput with Options::encoders; other errors name the run,
/// counted from 1. judge(observations, solutions, ...) judges the result.
[[nodiscard]] Result<TargetsIdentification> identify_targets(std::span<const TargetRun>,
                                                             const Machine& machine, const Noise&,
                                                             const Options& = {});

}  // namespace abbe::calib::otf

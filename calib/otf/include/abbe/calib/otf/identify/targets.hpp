#pragma once
/// Identification of all 18 tables from several runs in one adjustment, each with the reflector at
/// another offset from the tool reference point. One run leaves rotations that displace its only
/// target like translations; three targets that are not on a line determine them, and the model is
/// valid for any tool. The tracker may be set up again between the runs: every run is aligned by
/// itself and has six rigid unknowns of its own,
///     y_k = A_k (U, T_k, r_k) + noise,   k = 1 .. number of runs
/// so an unknown constant error of each target offset does not matter. The information of the runs
/// is added (estimation/information.hpp) and solved with the 24 conditions of datum G2 for 18
/// tables. With Estimator::Simultaneous each run is linearised again at the common solution
/// (simultaneous.hpp).
///
/// With Options::nests each run has a drift of the tracker of its own, from its visits and the rows
/// of all runs (tracker_drift.hpp). The nests are at the same places in the tracker frame in all
/// runs: the tracker is not set up again between runs with visits.
///
/// Each run has an offset of its ranges of its own, with the prior of Noise: between the runs the
/// reflector is moved, and often the tracker homed again. The offsets count as independent, as
/// those of the runs of a joint identification. The scale of the ranges and the scales of the axes
/// are those of Noise, common to all runs. The noise of the residuals is treated as in solve():
/// correlated noise widens the covariance (it is not prewhitened). The factor of the covariance is
/// that of all residuals together, or that of one run if this is larger.

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
  /// One per run. All have the same model; rigid, pose, range offset, residuals and statistics are
  /// of the run, adjustment and covariance are those of all runs for the unknowns of this run.
  std::vector<Solution> solutions;
  Statistics statistics;  ///< of all runs together

  [[nodiscard]] const VolumetricModel& model() const { return solutions.front().model; }
};

/// `machine.target_offset_m` is not used. DegenerateGeometry if the offsets are on a line (0.5 mm);
/// BadInput with Options::encoders; other errors name the run, counted from 1.
/// judge(observations, solutions, ...) judges the result.
[[nodiscard]] Result<TargetsIdentification> identify_targets(std::span<const TargetRun>,
                                                             const Machine& machine, const Noise&,
                                                             const Options& = {});

}  // namespace abbe::calib::otf

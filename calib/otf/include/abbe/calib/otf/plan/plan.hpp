#pragma once
/// Plans a path for on-the-fly calibration: the path of a given length, or a given duration, with
/// the smallest predicted uncertainty (plan_prediction.hpp).
///
/// 1. Walk: starts at the corner with the smallest axis positions, on a lattice over the travel.
///    Each step takes the leg with the largest
///        gain = trace((I + A C A^T)^-1 A C G C A^T) / length
///    C = (H + prior)^-1; A: weighted rows of the leg; G: see plan_prediction.hpp. The gain is the
///    decrease of trace(G C) by the leg. H: information of the walk so far, plus that of the
///    remaining length if it were optimally distributed over all legs.
/// 2. Exchange: vertices are inserted, removed or moved, or a part is reversed, while this
///    decreases trace(G C) times length. (Noise decreases with the root of the length, so that this
///    product compares paths of different lengths.)
/// 3. Descent: vertices leave the lattice along the gradient of trace(G C), at constant length.
///
/// A path that consists only of edges and full diagonals hardly determines a positioning error that
/// is common to all axes. Oblique legs that do not join opposite corners determine it, and the gain
/// selects such legs. Deterministic: no random numbers. Units: m, s.

#include <cstddef>
#include <functional>
#include <limits>

#include "abbe/calib/otf/plan/plan_prediction.hpp"

namespace abbe::calib::otf {

/// A path of the kind used in [Sanders 2023], for comparison: 61 legs along edges, face and space
/// diagonals and centre lines of the travel.
[[nodiscard]] Path base_path(const MachineNodes&);

struct PathBudget {
  double length_m = std::numeric_limits<double>::infinity();
  double duration_s = std::numeric_limits<double>::infinity();
};

struct PlanOptions {
  /// Lattice points for each axis, 3 to 7: ends and equal steps.
  std::size_t lattice = 5;
  /// Largest number of exchanges that are evaluated, about 2 ms each for 169 unknowns; 0: the walk
  /// alone. For the reference machine rms_u_m decreases from 0.0847 um to 0.0829 um with 7,000
  /// exchanges, to 0.0819 um with 12,000 and to 0.0815 um with 18,000.
  std::size_t exchanges = 12'000;
  Stopped stopped = {};  ///< as Options::stopped
  /// If it returns true, exchange and descent end, and the path found so far is the result. It is
  /// called before `stopped`. Empty: no early end.
  Stopped enough = {};
  /// Called with the share of the exchanges done, 0 to 1, and the estimated rms_u_m of the path
  /// found so far.
  std::function<void(double share, double rms_u_m)> progress = {};
};

struct PlannedPath {
  Path path;
  double walk_rms_u_m = 0.0;  ///< estimate after the walk
  double rms_u_m = 0.0;       ///< estimate at the end; predict() states the value of a run
  bool ended_early = false;   ///< true: PlanOptions::enough ended exchange or descent
  /// Number of corners of the travel that the path does not reach. The model is not valid there.
  std::size_t corners_not_reached = 0;
};

/// Plans a path. Vertices are multiples of 0.1 mm, and the path is not longer than the budget.
/// Errors of check(PlannedRun). BadInput for a budget that is neither a positive length nor a
/// positive duration, or that is too short for a path that determines the model; the text states
/// the length that the walk needs. NotConverged if stopped.
[[nodiscard]] Result<PlannedPath> plan(const PlannedRun&, const PathBudget&,
                                       const PlanOptions& = {});

}  // namespace abbe::calib::otf

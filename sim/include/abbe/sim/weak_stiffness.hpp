#pragma once
/// The weak-stiffness machine of [Li OMM] (Table 3): base, Z, X, Y, probe; 3.3 mm of error over the
/// volume of a ball array. Its errors are polynomials of order 3 in the readings; where Table 3
/// names only a sum (of a straightness and a squareness, say) one of them carries all of it.
/// Written without a look at `calib`. Pure.

#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim {

struct WeakStiffnessOptions {
  /// What no polynomial of order 3 holds: sag under a travelling weight near X 250 mm, and a
  /// screw's pitch.
  double sag_m = 0.0;       ///< at Y = 0.5 m
  double periodic_m = 0.0;  ///< of X along X
  double period_m = 20e-3;  ///< of the screw
};

/// V(Ball1 of the reference layout) is 0 without sag and pitch. Ranges, order and target are those
/// of the machine.
[[nodiscard]] TruthMachine weak_stiffness_machine(const WeakStiffnessOptions& options = {});

}  // namespace abbe::sim

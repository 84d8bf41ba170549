#pragma once
/// The weak-stiffness machine of [Li OMM] (Table 3): base, Z, X, Y, probe; 3.3 mm of error over the
/// volume of a ball array. Its errors are polynomials of order 3 in the readings; where Table 3
/// gives only a sum (e.g. of a straightness and a squareness), one of the terms has the whole
/// value.
/// Written independently of `calib`. Pure.

#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim {

struct WeakStiffnessOptions {
  /// Errors that a polynomial of order 3 cannot describe: sag under a moving load near X = 250 mm,
  /// and the periodic error of a screw.
  double sag_m = 0.0;       ///< amplitude of the sag at Y = 0.5 m
  double periodic_m = 0.0;  ///< amplitude of the error of X along X
  double period_m = 20e-3;  ///< period of the screw
};

/// V is 0 at ball 1 of the reference ball array, without sag and periodic error. Ranges, order and
/// target are those of the machine.
[[nodiscard]] TruthMachine weak_stiffness_machine(const WeakStiffnessOptions& options = {});

}  // namespace abbe::sim

#pragma once
/// The optimal distribution of a length over the legs of a lattice, under the relaxed condition
/// that legs need not be connected and can be driven in part: an approximate design in the sense of
/// [Pukelsheim 2006]. Its trace(G C) is a lower bound for every connected path on the lattice.

#include <Eigen/Core>
#include <span>

#include "plan/plan_problem.hpp"

namespace abbe::calib::otf {

struct RelaxedDesign {
  Eigen::MatrixXd H_per_m;  ///< information for each metre of path, lower triangle
  double mean_leg_m = 0.0;  ///< mean length of its legs
  double value_m2 = 0.0;    ///< trace(G C) of the optimum, in m^2
};

/// Computes the design by the multiplicative algorithm: the weight of each leg is multiplied by a
/// power of its gain per metre, relative to the mean over all legs. NotConverged if stopped.
[[nodiscard]] Result<RelaxedDesign> relaxed_design(const PlanProblem&,
                                                   std::span<const Vector3> lattice,
                                                   double length_m, const Stopped&);

}  // namespace abbe::calib::otf

#pragma once
/// The best distribution of a length over the legs of a lattice, if legs needed no connections and
/// could be driven in part: an approximate design in the sense of [Pukelsheim 2006]. No connected
/// path on the lattice has a smaller trace(G C) than its optimum.

#include <Eigen/Core>
#include <span>

#include "plan/plan_problem.hpp"

namespace abbe::calib::otf {

struct RelaxedDesign {
  Eigen::MatrixXd H_per_m;  ///< information for each metre of path, lower triangle
  double mean_leg_m = 0.0;  ///< mean length of its legs
  double value_m2 = 0.0;    ///< trace(G C)
};

/// By the multiplicative algorithm: the weight of each leg is multiplied by a power of what a metre
/// of it is worth, relative to the mean of all. NotConverged if stopped.
[[nodiscard]] Result<RelaxedDesign> relaxed_design(const PlanProblem&,
                                                   std::span<const Vector3> lattice,
                                                   double length_m, const Stopped&);

}  // namespace abbe::calib::otf

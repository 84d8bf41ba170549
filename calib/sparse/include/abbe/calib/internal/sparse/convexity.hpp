#pragma once
/// Tests whether the objective of penalised least squares (penalty.hpp) is convex around a
/// solution.

#include <Eigen/Core>
#include <optional>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/internal/sparse/path.hpp"

namespace abbe::calib::sparse {

/// Tells whether the objective of penalised least squares (penalty.hpp) is convex around a
/// solution. It is the diagnostic of [Breheny 2011] for every solution k of a path: smallest
/// eigenvalue of X_U' X_U / n - concavity * I. X_U: the columns of X with a nonzero coefficient in
/// solution k or k + 1 (for the last solution: in this solution). If it is negative, the objective
/// is not convex around the solution, and other minima may be near. Infinite if X_U has no columns.
struct Convexity {
  Eigen::VectorXd smallest_eigenvalue;          ///< for each reached lambda of the path
  std::optional<Eigen::Index> first_nonconvex;  ///< index of lambda; nullopt: convex everywhere
};
[[nodiscard]] Result<Convexity> convexity(const Eigen::MatrixXd& X, const Path&);

}  // namespace abbe::calib::sparse

#pragma once
/// Checks of a solution of penalised least squares (penalty.hpp): the first-order conditions, and
/// whether the objective is convex around the solution.

#include <Eigen/Core>
#include <optional>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/internal/sparse/path.hpp"

namespace abbe::calib::sparse {

/// Largest violation, in units of y, of the conditions that a stationary point b of the
/// standardised problem satisfies. With column x_j of X, n rows, penalty p and g_j = x_j' (y - X b)
/// / n they are
///     |g_j| <= lambda                where b_j = 0,
///     g_j = sgn(b_j) p'(|b_j|)       elsewhere.
/// `b` has one coefficient for each column of X, as Path::standardised; columns that do not vary
/// are ignored. The violation is 0 to rounding at a stationary point; for a fitted path it is of
/// the order of the tolerance times the condition number.
[[nodiscard]] Result<double> kkt_violation(const Eigen::MatrixXd& X, const Eigen::VectorXd& y,
                                           const Penalty&, double lambda, const Eigen::VectorXd& b);

/// Objective 1/(2n) |y - X b|^2 + sum p(|b_j|) of the standardised problem with n rows, p: penalty.
[[nodiscard]] Result<double> objective(const Eigen::MatrixXd& X, const Eigen::VectorXd& y,
                                       const Penalty&, double lambda, const Eigen::VectorXd& b);

/// The convexity diagnostic of [Breheny 2011] for every solution k of a path: smallest eigenvalue
/// of X_U' X_U / n - concavity * I. X_U: the columns of X with a nonzero coefficient in solution k
/// or k + 1 (for the last solution: in this solution). If negative, the objective is not convex
/// around the solution, and other minima may be near. Infinite if X_U has no columns.
struct Convexity {
  Eigen::VectorXd smallest_eigenvalue;          ///< of each reached lambda of the path
  std::optional<Eigen::Index> first_nonconvex;  ///< index of lambda; nullopt: convex everywhere
};
[[nodiscard]] Result<Convexity> convexity(const Eigen::MatrixXd& X, const Path&);

}  // namespace abbe::calib::sparse

#pragma once
/// How good a solution is: the first-order conditions, and whether the objective is convex around
/// it.

#include <Eigen/Core>
#include <optional>

#include "abbe/calib/error.hpp"
#include "abbe/calib/sparse/path.hpp"

namespace abbe::calib::sparse {

/// Largest violation, in units of y, of the conditions at a stationary point b of the standardised
/// problem, with g_j = x_j' (y - X b) / n: |g_j| <= lambda where b_j = 0, else g_j = sgn(b_j)
/// p'(|b_j|). `b` has the columns of X, as Path::standardised; columns that do not vary count for
/// nothing. 0 to rounding at a stationary point, of the order of the tolerance times the condition
/// in practice.
[[nodiscard]] Result<double> kkt_violation(const Eigen::MatrixXd& X, const Eigen::VectorXd& y,
                                           const Penalty&, double lambda, const Eigen::VectorXd& b);

/// 1/(2n) |y - X b|^2 + sum p(|b_j|) of the standardised problem.
[[nodiscard]] Result<double> objective(const Eigen::MatrixXd& X, const Eigen::VectorXd& y,
                                       const Penalty&, double lambda, const Eigen::VectorXd& b);

/// The convexity diagnostic of [Breheny 2011]: smallest eigenvalue of X_U' X_U / n - concavity * I
/// over the union U of the supports of neighbouring solutions k and k + 1 (the last one: its own).
/// Negative: the objective is not convex there and other minima may be near. Infinite where U is
/// empty.
struct Convexity {
  Eigen::VectorXd smallest_eigenvalue;          ///< reached() of the path
  std::optional<Eigen::Index> first_nonconvex;  ///< index of lambda; none: locally convex all along
};
[[nodiscard]] Result<Convexity> convexity(const Eigen::MatrixXd& X, const Path&);

}  // namespace abbe::calib::sparse

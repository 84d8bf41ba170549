#pragma once
/// Computes solutions of penalised least squares along decreasing lambda by cyclic coordinate
/// descent with warm starts, strong and active sets ([Breheny 2011], [Tibshirani 2012]), with the
/// semantics of the R package ncvreg 3.16, so that solutions and iteration counts can be compared:
///   - Columns are standardised (standardise.hpp), y is centred, the intercept is always fitted and
///     never penalised.
///   - One iteration is one sweep over the active columns in the order of the columns. A lambda is
///     finished when the largest change of a standardised coefficient in a sweep is below
///     tolerance * rms(y - mean) and no inactive column would get a nonzero coefficient.
///   - The budget counts the sweeps of the whole path. When it is used up, the current lambda keeps
///     the coefficients it has, and the solutions of the remaining lambdas are missing
///     (Path::reached() < Path::lambda.size()).
/// The result is a stationary point only to within the tolerance: with badly conditioned columns
/// the result depends on the order of the columns. MCP and SCAD have many local minima; the warm
/// start determines which one is found.
///
/// Works on the Gram matrix of the columns. For n rows and p columns: memory p^2, time n p^2 once
/// and p^2 per sweep; intended for n > p and up to a few thousand columns. Pure, no threads. The
/// same input gives the same bits on every x86-64 processor, for a single path and in a grid.

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/internal/sparse/penalty.hpp"

namespace abbe::calib::sparse {

struct PathOptions {
  /// Values of lambda in decreasing order (equal values are permitted), none negative. Empty: 100
  /// values equally spaced in the logarithm, from lambda_max down to 0.001 lambda_max for n > p (n
  /// rows, p columns), else 0.05 lambda_max. lambda_max = max_j |x_j' y| / n is the smallest lambda
  /// for which all coefficients are zero (x_j: standardised columns); it costs no sweep.
  std::vector<double> lambda{};
  double tolerance = 1e-4;  ///< relative to rms(y - mean); 1e-4 as in ncvreg
  long max_sweeps = 10000;  ///< budget of sweeps of the whole path; 10000 as in ncvreg
  /// Limit of nonzero coefficients: the path ends at the first lambda with more; nullopt: no limit.
  std::optional<Eigen::Index> max_nonzero{};
};

/// A path of solutions. Column k of the matrices belongs to lambda[k]; only the first reached()
/// values of lambda have a column.
struct Path {
  Penalty penalty;
  std::vector<double> lambda;  ///< all requested values
  std::vector<long> sweeps;    ///< number of sweeps for each reached lambda
  /// p x reached, coefficients of standardised columns, in units of y; 0 for dropped columns.
  Eigen::MatrixXd standardised;
  Eigen::MatrixXd coefficients;          ///< (1 + p) x reached, original units, intercept first
  Eigen::VectorXd residual_sum_squares;  ///< |y - fit|^2
  std::vector<Eigen::Index> dropped;     ///< columns that do not vary
  bool budget_exhausted = false;         ///< the last reached lambda may not have converged

  [[nodiscard]] Eigen::Index reached() const { return coefficients.cols(); }
};

/// Computes a path. BadInput: shapes differ, lambda increasing or negative, gamma, tolerance or
/// budget out of range, no column varies. NotFinite: NaN or infinity. TooFewObservations: fewer
/// than two rows, or y does not vary.
[[nodiscard]] Result<Path> fit_path(const Eigen::MatrixXd& X, const Eigen::VectorXd& y,
                                    const Penalty&, const PathOptions& = {});

}  // namespace abbe::calib::sparse

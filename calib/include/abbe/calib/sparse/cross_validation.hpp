#pragma once
/// Choice of lambda, or of gamma and lambda together, by cross-validation. For every gamma a path
/// of all rows and one of each fold's training rows (standardised anew); a cell is the mean over
/// all rows of the squared error of the fit that did not see the row. Cells that some fold or the
/// full path did not reach within its budget are missing (NaN). The smallest cell wins, the first
/// one (smallest index of gamma, then of lambda) on ties. See folds.hpp on rows that share noise.

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <vector>

#include "abbe/calib/error.hpp"
#include "abbe/calib/sparse/folds.hpp"
#include "abbe/calib/sparse/path.hpp"

namespace abbe::calib::sparse {

/// Calls task(0) .. task(count - 1), each once, in any order and on any threads, and returns when
/// all have returned. This library makes no threads: whoever has some lends them here. The tasks
/// share nothing they write; results do not depend on how they are run.
using ParallelFor =
    std::function<void(std::size_t count, const std::function<void(std::size_t)>& task)>;
void serial_for(std::size_t count, const std::function<void(std::size_t)>& task);

struct CrossValidation {
  Path path;  ///< of all rows
  Eigen::VectorXd
      error;  ///< mean squared held-out error, unit of y squared; NaN: missing; lambda.size()
  Eigen::VectorXd
      standard_error;  ///< of error, rows taken as independent (too small when rows share noise)
  double null_error = 0.0;  ///< mean (y - mean)^2: what the empty model leaves
  Eigen::Index best = 0;    ///< index of lambda
};

/// Errors of fit_path, also for every fold's training rows (TooFewObservations names the fold), and
/// BadInput when `folds` is not for these rows; NotConverged when no cell was reached.
[[nodiscard]] Result<CrossValidation> cross_validate(const Eigen::MatrixXd& X,
                                                     const Eigen::VectorXd& y, const Penalty&,
                                                     const Folds&, const PathOptions& = {},
                                                     const ParallelFor& = serial_for);

struct GridCell {
  Eigen::Index lambda = 0, gamma = 0;  ///< indices
};

struct GridSearch {
  std::vector<double> gamma;
  std::vector<double> lambda;
  Eigen::MatrixXd error;  ///< lambda x gamma, as in CrossValidation: the surface to plot
  Eigen::MatrixXd standard_error;
  std::vector<Path> paths;  ///< of all rows, one for each gamma
  double null_error = 0.0;
  GridCell best;
  long sweeps = 0;  ///< of all paths, folds included

  [[nodiscard]] Eigen::VectorXd best_coefficients() const {
    return paths[static_cast<std::size_t>(best.gamma)].coefficients.col(best.lambda);
  }
};

/// As cross_validate at each of `gamma`, bit for bit, in one go: the paths of one fold share its
/// Gram matrix and run side by side in vector registers. One task for all rows and one for each
/// fold.
[[nodiscard]] Result<GridSearch> grid_search(const Eigen::MatrixXd& X, const Eigen::VectorXd& y,
                                             PenaltyKind, const std::vector<double>& gamma,
                                             const Folds&, const PathOptions& = {},
                                             const ParallelFor& = serial_for);

/// `count` values equally spaced from first to last, both included.
[[nodiscard]] std::vector<double> equally_spaced(double first, double last, int count);
/// The same in the logarithm, for lambda from large to small.
[[nodiscard]] std::vector<double> log_spaced(double first, double last, int count);

}  // namespace abbe::calib::sparse

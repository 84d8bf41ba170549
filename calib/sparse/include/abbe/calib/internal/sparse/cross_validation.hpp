#pragma once
/// Chooses lambda, or gamma and lambda together (penalty.hpp), by cross-validation. For every gamma
/// one regularisation path is fitted to all rows and one to the training rows of each fold
/// (standardised separately). The error of a pair (lambda, gamma) is the mean over all rows of the
/// squared error of the fit that did not use the row; it is missing (NaN) if one of these paths did
/// not reach lambda within its sweep budget. The pair with the smallest error is chosen, on ties
/// the one with the smallest index of gamma, then of lambda. For rows that share noise see
/// folds.hpp.

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <vector>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/internal/sparse/path.hpp"
#include "abbe/calib/sparse/folds.hpp"

namespace abbe::calib::sparse {

/// A function of the caller that calls task(0) .. task(count - 1), each once, in any order and on
/// any threads, and returns when all have returned. This library creates no threads; a caller that
/// has threads supplies them through this function. The tasks write no shared data; results do not
/// depend on the order and the threads.
using ParallelFor =
    std::function<void(std::size_t count, const std::function<void(std::size_t)>& task)>;
void serial_for(std::size_t count, const std::function<void(std::size_t)>& task);

struct GridCell {
  Eigen::Index lambda = 0, gamma = 0;  ///< indices
};

struct GridSearch {
  std::vector<double> gamma;
  std::vector<double> lambda;
  Eigen::MatrixXd error;    ///< lambda x gamma, mean squared held-out error; NaN: missing
  std::vector<Path> paths;  ///< fitted to all rows, one for each gamma
  GridCell best;
  long sweeps = 0;  ///< number of sweeps of all paths, including folds
};

/// Computes the errors for all pairs and selects the best. Gives the same bits as one call for each
/// gamma, but takes less time: the paths of one fold for all gamma use the same Gram matrix and are
/// computed in parallel lanes of the vector registers. `ParallelFor` gets one task for all rows and
/// one for each fold. Errors of fit_path, also for the training rows of every fold
/// (TooFewObservations names the fold); BadInput if `folds` does not match the rows or `gamma` is
/// empty; NotConverged if the error is missing for every pair.
[[nodiscard]] Result<GridSearch> grid_search(const Eigen::MatrixXd& X, const Eigen::VectorXd& y,
                                             PenaltyKind, const std::vector<double>& gamma,
                                             const Folds&, const PathOptions& = {},
                                             const ParallelFor& = serial_for);

/// `count` values equally spaced from first to last, both included.
[[nodiscard]] std::vector<double> equally_spaced(double first, double last, int count);
/// `count` values equally spaced in the logarithm from first to last; used for lambda from large to
/// small.
[[nodiscard]] std::vector<double> log_spaced(double first, double last, int count);

}  // namespace abbe::calib::sparse

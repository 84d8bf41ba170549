#pragma once
/// Computes squared errors of the rows of one fold, predicted by the paths that are fitted to the
/// other folds.

#include <Eigen/Core>
#include <vector>

#include "abbe/calib/sparse/folds.hpp"
#include "path_setup.hpp"

namespace abbe::calib::sparse {

/// Number and mean of squared errors. add() merges another set: the mean is then that of both sets.
struct MeanError {
  double count = 0.0;
  double mean = 0.0;

  void add(const MeanError& more);
};

struct HeldOut {
  std::vector<std::vector<MeanError>> error;  ///< by penalty, then by each lambda that its path
                                              ///< reached
  long sweeps = 0;
};

/// Fits the rows of `all` that are not in `fold` and computes the errors of the rows in `fold`. The
/// rows of `all` are standardised; the training rows are standardised again.
[[nodiscard]] Result<HeldOut> hold_out(const GramProblem& all, const Folds&, int fold,
                                       const std::vector<Penalty>&, const LambdaList&,
                                       const PathOptions&);

}  // namespace abbe::calib::sparse

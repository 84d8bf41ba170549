#pragma once
/// Squared errors of the rows of one fold under the paths of the others.

#include <Eigen/Core>
#include <vector>

#include "abbe/calib/sparse/folds.hpp"
#include "sparse/path_setup.hpp"

namespace abbe::calib::sparse {

/// Count, mean and sum of squared deviations from the mean: adds up over folds without
/// cancellation.
struct Moments {
  double count = 0.0;
  double mean = 0.0;
  double squares = 0.0;

  void add(const Moments& more);
};

struct HeldOut {
  std::vector<std::vector<Moments>> error;  ///< of each penalty, each lambda it reached
  long sweeps = 0;
};

/// Fits the rows of `all` (standardised by the whole, then anew) that are not in `fold`, judges by
/// those that are.
[[nodiscard]] Result<HeldOut> hold_out(const GramProblem& all, const Folds&, int fold,
                                       const std::vector<Penalty>&, const LambdaList&,
                                       const PathOptions&);

}  // namespace abbe::calib::sparse

#include "judge/drift_held_out.hpp"

#include <algorithm>
#include <vector>

#include "abbe/calib/internal/otf/observe/row_residuals.hpp"
#include "abbe/calib/otf/judge/lack_of_fit.hpp"
#include "abbe/result/try.hpp"
#include "nests/drift_estimate.hpp"
#include "solve/run_statistics.hpp"

namespace abbe::calib::otf {

Result<Eigen::VectorXd> DriftHeldOut::correct(Eigen::VectorXd& U, const Adjustment& a,
                                              const std::function<bool(const Observation&)>& take,
                                              const Stopped& stopped) const {
  const std::vector<double> r_m = residuals_m(o_, a.U);
  const AddedColumns::Reduced reduced =
      columns_.sums(WhitenedRows(o_), r_m, take).reduced(a.cofactor_Q);
  const std::size_t freedom = o_.rows.size() - a.rank;
  const double factor = std::max(1.0, variance_factor(residual_noise(o_, r_m, freedom), freedom));

  // `removed_` was subtracted from the rows, so that their unknown is d minus the removed drift.
  // Prior and visits refer to d itself: the equations are converted to d.
  DriftEquations equations{.S = reduced.S / factor};
  equations.g = reduced.g / factor + equations.S * removed_.coefficients;
  const Result<DriftEstimate> estimate = estimate_drift(*o_.drift, equations, stopped);
  ABBE_TRY(estimate);

  Eigen::VectorXd change = estimate->d - removed_.coefficients;
  U -= reduced.dU_dd * change;
  return change;
}

}  // namespace abbe::calib::otf

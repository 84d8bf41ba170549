#pragma once
/// Estimates the drift of the tracker without the held-out legs of a run. If the held-out legs took
/// part in this estimate, they would be predicted too well.

#include <functional>

#include "abbe/calib/otf/solve/solve.hpp"
#include "solve/drift_columns.hpp"

namespace abbe::calib::otf {

class DriftHeldOut {
 public:
  /// `without_drift`: observations from which `removed`, the drift of the whole run, is subtracted.
  /// Both must outlive it.
  DriftHeldOut(const Observations& without_drift, const TrackerDrift& removed)
      : o_(without_drift), removed_(removed), columns_(without_drift) {}

  /// Estimates the drift from the rows for which `take` returns true and the visits, with the
  /// adjustment of these rows, and corrects U for it. Returns the coefficients of the drift of
  /// these rows minus the removed drift. NotConverged if `stopped` returns true.
  [[nodiscard]] Result<Eigen::VectorXd> correct(Eigen::VectorXd& U, const Adjustment&,
                                                const std::function<bool(const Observation&)>& take,
                                                const Stopped& stopped) const;
  /// Effect on y of a row of the change of the drift that correct() returned.
  [[nodiscard]] double effect_m(std::size_t row, const Eigen::VectorXd& change) const {
    return columns_.effect_m(o_.rows[row], change);
  }

 private:
  const Observations& o_;
  const TrackerDrift& removed_;
  DriftColumns columns_;
};

}  // namespace abbe::calib::otf

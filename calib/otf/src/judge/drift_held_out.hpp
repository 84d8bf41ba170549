#pragma once
/// The drift of the tracker without the held-out legs of a run: legs that take part in the estimate
/// of the drift would be predicted too well.

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
  /// adjustment of these rows, and corrects U for it. Result: drift of these rows minus the removed
  /// one, as coefficients. NotConverged if `stopped` returns true.
  [[nodiscard]] Result<Eigen::VectorXd> correct(Eigen::VectorXd& U, const Adjustment&,
                                                const std::function<bool(const Observation&)>& take,
                                                const Stopped& stopped) const;
  /// What remains of the drift in y of a row.
  [[nodiscard]] double effect_m(std::size_t row, const Eigen::VectorXd& change) const {
    return columns_.effect_m(o_.rows[row], change);
  }

 private:
  const Observations& o_;
  const TrackerDrift& removed_;
  DriftColumns columns_;
};

}  // namespace abbe::calib::otf

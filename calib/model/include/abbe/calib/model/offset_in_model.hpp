#pragma once
/// The range offset of a laser tracker as it is in the covariance of a model. Pure data.

#include <Eigen/Core>
#include <string>

namespace abbe::calib {

/// Estimate of the range offset d together with the parameters U of a model in datum G2, with the
/// covariance C. Given d, the model and its covariance are
///     U - dU_dd (d - value),   C - u^2 dU_dd dU_dd^T
/// so that runs with one and the same offset can be combined (joint/part.hpp, model_update.hpp).
struct OffsetInModel {
  Eigen::VectorXd dU_dd;  ///< derivative of the parameters U by d, m/m or rad/m
  double value_m = 0.0;   ///< estimate with the prior N(0, u_prior^2)
  double u_m = 0.0;
  double u_prior_m = 0.0;
};

/// The place of a tracker from which a model was measured, and the offset of its ranges. Other runs
/// from this place have the same offset if home position and reflector are the same.
struct TrackerPlace {
  std::string name;
  OffsetInModel range_offset;
};

}  // namespace abbe::calib

#pragma once
/// The estimate of the parameters as a linear function of the deviations: U = sum H_pass
/// delta_pass.

#include "abbe/calib/mfb/solve/solve.hpp"

namespace abbe::calib::mfb {

struct LinearEstimator {
  std::vector<Eigen::MatrixXd> of_pass;  ///< H of each pass: parameters x 3N
};
[[nodiscard]] Result<LinearEstimator> linear_estimator(const Observations&, const SolveOptions&);

}  // namespace abbe::calib::mfb

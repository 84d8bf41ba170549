#pragma once
/// When an iteration of the simultaneous adjustment has converged.

#include <Eigen/Dense>
#include <cmath>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::otf {

/// Size of a change of the estimate in units of its standard uncertainty.
[[nodiscard]] inline double change_in_u(const Eigen::VectorXd& change,
                                        const estimation::Information& data) {
  const Eigen::VectorXd whitened = data.R() * change;
  return whitened.norm() / std::sqrt(static_cast<double>(change.size()));
}

}  // namespace abbe::calib::otf

#pragma once
/// Convergence criterion of the simultaneous adjustment.

#include <Eigen/Dense>
#include <cmath>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::otf {

/// Size of a change of the estimate divided by its standard uncertainty (root mean square). The
/// simultaneous adjustment uses it to decide whether it has converged.
[[nodiscard]] inline double change_in_u(const Eigen::VectorXd& change,
                                        const estimation::Information& data) {
  const Eigen::VectorXd whitened = data.R() * change;
  return whitened.norm() / std::sqrt(static_cast<double>(change.size()));
}

}  // namespace abbe::calib::otf

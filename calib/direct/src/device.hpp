#pragma once
/// Selects positions of runs, and computes the covariance from the uncertainty of the device.

#include <Eigen/Core>
#include <functional>
#include <span>

#include "abbe/calib/direct/compare.hpp"

namespace abbe::calib::direct {

/// The runs at those positions that `keep` accepts.
[[nodiscard]] Runs at_positions(const Runs&, const std::function<bool(double position_m)>& keep);

/// Covariance of P times the values at the positions, from the uncertainty of the device alone.
[[nodiscard]] Eigen::MatrixXd covariance_of_device(ErrorMotion, const Eigen::MatrixXd& P,
                                                   std::span<const double> positions_m,
                                                   const DeviceUncertainty&);

}  // namespace abbe::calib::direct

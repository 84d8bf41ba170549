#pragma once
/// Computes the Information of dense rows that are all in memory, with one blocked QR
/// decomposition.

#include <Eigen/Core>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::estimation {

/// Whitened rows A and y; any number of rows.
[[nodiscard]] Information information_of(const Eigen::MatrixXd& A, const Eigen::VectorXd& y);

}  // namespace abbe::calib::estimation

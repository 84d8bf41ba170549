#pragma once
/// Compiled once: the decomposition is by far the largest template of the room.

#include <Eigen/Core>

namespace abbe::calib {

/// Descending; by QR, then Jacobi rotations of R: small values keep their accuracy relative to the
/// columns' scale.
[[nodiscard]] Eigen::VectorXd singular_values(const Eigen::MatrixXd& A);

}  // namespace abbe::calib

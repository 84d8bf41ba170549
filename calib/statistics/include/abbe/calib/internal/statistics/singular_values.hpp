#pragma once
/// Singular values of a matrix.

#include <Eigen/Core>

namespace abbe::calib {

/// Singular values of A in descending order, from the QR decomposition A = Q R and Jacobi rotations
/// of R. Small singular values are accurate relative to the scale of the columns of A. The function
/// has its own source file, because the decomposition is the largest template of `calib` and is
/// thus compiled only once.
[[nodiscard]] Eigen::VectorXd singular_values(const Eigen::MatrixXd& A);

}  // namespace abbe::calib

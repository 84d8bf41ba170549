#pragma once
/// Singular values of a matrix. The function has a source file of its own so that the
/// decomposition, the largest template of this module, is compiled only once.

#include <Eigen/Core>

namespace abbe::calib {

/// Singular values of A in descending order, from the QR decomposition A = Q R and Jacobi rotations
/// of R. Small singular values are accurate relative to the scale of the columns of A.
[[nodiscard]] Eigen::VectorXd singular_values(const Eigen::MatrixXd& A);

}  // namespace abbe::calib

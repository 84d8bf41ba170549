#pragma once
/// Products of triangular matrices in loops along the memory: a compiler turns them into vector
/// instructions without changing the order of any sum, which it does not do with Eigen's products.

#include "abbe/calib/internal/mfb/solve/shared_unknowns.hpp"

namespace abbe::calib::mfb {

/// R^-1 of an upper triangular matrix.
[[nodiscard]] RowMajorRows inverse_of_upper(const RowMajorRows& R);
/// X X^T of an upper triangular matrix.
[[nodiscard]] Eigen::MatrixXd upper_times_transpose(const RowMajorRows& X);
/// A X, X upper triangular.
[[nodiscard]] RowMajorRows times_upper(const RowMajorRows& A, const RowMajorRows& X);
/// Largest singular value, by power iteration; relative error 1e-2.
[[nodiscard]] double largest_singular_value(const RowMajorRows& A);

}  // namespace abbe::calib::mfb

#pragma once
/// Products of triangular matrices, with loops in the order of memory. A compiler vectorises these
/// loops without changing the order of any sum, which it does not do with Eigen's products.

#include "abbe/calib/internal/mfb/solve/shared_unknowns.hpp"

namespace abbe::calib::mfb {

/// The inverse R^-1 of an upper triangular matrix.
[[nodiscard]] RowMajorRows inverse_of_upper(const RowMajorRows& R);
/// The product X X^T of an upper triangular matrix.
[[nodiscard]] Eigen::MatrixXd upper_times_transpose(const RowMajorRows& X);
/// The product A X of a matrix and an upper triangular matrix X.
[[nodiscard]] RowMajorRows times_upper(const RowMajorRows& A, const RowMajorRows& X);
/// Largest singular value, by power iteration; relative error 1e-2.
[[nodiscard]] double largest_singular_value(const RowMajorRows& A);

}  // namespace abbe::calib::mfb

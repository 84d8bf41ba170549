#pragma once
/// The inner loop of the square-root information.

#include <cstddef>

namespace abbe::calib::estimation {

/// Both matrices by rows of `unknowns` + 1 values; the last column is a right-hand side. Replaces
/// the upper triangular matrix `triangle` by that of [triangle; rows] and `rows` by zeros except
/// for the last column, whose squares are the residual sum of squares. Rows of zeros and leading
/// zeros of a row cost nothing.
void update_triangle(double* triangle, double* rows, std::size_t count, std::size_t unknowns);

}  // namespace abbe::calib::estimation

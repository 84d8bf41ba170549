#pragma once
/// Adds rows to a triangular matrix: the inner loop of Information (estimation/information.hpp).

#include <cstddef>

namespace abbe::calib::estimation {

/// The inner loop of Information (estimation/information.hpp). Replaces the upper triangular matrix
/// `triangle` by the triangular factor of [triangle; rows]. Replaces `rows` by zeros except for the
/// last column, whose sum of squares is the residual sum of squares. Both matrices are stored by
/// rows of `unknowns` + 1 values; the last column is a right-hand side. Rows of zeros and leading
/// zeros of a row take no time.
void update_triangle(double* triangle, double* rows, std::size_t count, std::size_t unknowns);

}  // namespace abbe::calib::estimation

#pragma once
/// Rank and condition of the data alone, without any datum. Columns are scaled to unit length
/// first, so that neither depends on the units of the unknowns.

#include <Eigen/Core>
#include <cstddef>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::estimation {

/// Singular values of the column-scaled R.
struct Spectrum {
  Eigen::VectorXd singular_values;  ///< descending
  std::size_t rank = 0;             ///< number of singular values above the threshold
  /// Rounding of n columns of unit length changes a singular value by
  ///     n sqrt(rows) eps times the largest
  /// at most: every column has an error of sqrt(rows n) eps, with the sign of the errors at random.
  double threshold = 0.0;
  /// largest singular value divided by the smallest one above the threshold; 0 for rank 0
  double condition = 0.0;
};
[[nodiscard]] Spectrum spectrum(const Information&);

/// Rank of the column-scaled R from a QR decomposition with column pivoting, with the threshold of
/// Spectrum. Its diagonal reveals the rank except for constructed matrices ([Golub 2013] section
/// 5.4). Takes less time than singular values.
[[nodiscard]] std::size_t pivoted_rank(const Information&);

/// Combinations of the unknowns that the data do not determine.
struct NullSpace {
  std::size_t rank = 0;   ///< pivoted_rank()
  Eigen::MatrixXd basis;  ///< unknowns() x datum defect, in the units of the unknowns
  /// of each scaled unknown in the combinations, 0 to 1
  Eigen::VectorXd share;
};
[[nodiscard]] NullSpace null_space(const Information&);

}  // namespace abbe::calib::estimation

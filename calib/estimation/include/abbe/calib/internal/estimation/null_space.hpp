#pragma once
/// Rank and condition of the data alone, without any datum (datum.hpp). Columns are scaled to unit
/// length first, so that rank and condition do not depend on the units of the unknowns.

#include <Eigen/Core>
#include <cstddef>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::estimation {

/// Singular values of the R of an Information, with columns scaled to unit length.
struct Spectrum {
  Eigen::VectorXd singular_values;  ///< in descending order
  std::size_t rank = 0;             ///< number of singular values above the threshold
  /// Smaller singular values count as zero. Rounding changes a singular value by at most
  ///     n sqrt(rows) eps times the largest singular value,
  /// n: number of columns, eps: machine precision. Each of the n columns of unit length has an
  /// error of sqrt(rows n) eps, because rounding errors have random signs. The argument
  /// `zero` replaces the factor of the largest singular value if it is larger.
  double threshold = 0.0;
  /// largest singular value divided by the smallest one above the threshold; 0 for rank 0
  double condition = 0.0;
};
[[nodiscard]] Spectrum spectrum(const Information&, double zero = 0.0);

/// Rank of the column-scaled R from a QR decomposition with column pivoting, with the threshold of
/// Spectrum. The diagonal of the triangular factor shows the rank, except for specially constructed
/// matrices ([Golub 2013] section 5.4). Takes less time than singular values.
[[nodiscard]] std::size_t pivoted_rank(const Information&, double zero = 0.0);

/// Combinations of the unknowns that the data do not determine.
struct NullSpace {
  std::size_t rank = 0;   ///< as returned by pivoted_rank()
  Eigen::MatrixXd basis;  ///< unknowns() x datum defect, in the units of the unknowns
  /// for each column-scaled unknown: 0 if the data determine it, 1 if the data contain nothing
  /// about it
  Eigen::VectorXd share;
};
[[nodiscard]] NullSpace null_space(const Information&);
/// As null_space(), for a given rank of at most unknowns(). The basis consists of the unknowns() -
/// rank combinations that are determined worst.
[[nodiscard]] NullSpace null_space_of_rank(const Information&, std::size_t rank);

}  // namespace abbe::calib::estimation

#pragma once
/// Scales columns to mean 0 and mean square 1 (divided by n, not n - 1), and converts coefficients
/// to the original columns.

#include <Eigen/Core>
#include <vector>

#include "abbe/calib/base/error.hpp"

namespace abbe::calib::sparse {

/// Columns whose root mean square deviation from their mean is at most this are dropped: their
/// coefficient is 0.
inline constexpr double kConstantColumn = 1e-6;

struct Standardised {
  Eigen::MatrixXd X;               ///< n x kept columns
  std::vector<Eigen::Index> kept;  ///< index in the original design, increasing
  Eigen::VectorXd mean;            ///< mean of each kept column
  Eigen::VectorXd scale;           ///< root mean square about the mean of each kept column
  Eigen::Index original_columns = 0;
};

/// Standardises the columns of X. BadInput: no rows, or no column varies. NotFinite: NaN, infinity,
/// or squares that overflow.
[[nodiscard]] Result<Standardised> standardise(const Eigen::MatrixXd& X);

/// Coefficients in the units of the original design: row 0 the intercept, row 1 + j column j; one
/// column for each column of `b`.
[[nodiscard]] Eigen::MatrixXd to_original(const Standardised&, const Eigen::MatrixXd& b,
                                          double y_mean);

}  // namespace abbe::calib::sparse

#pragma once
/// The columns of the alternatives that a ball array's errors are compared with, and their words.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "abbe/calib/evemu/lack_of_fit.hpp"

namespace abbe::calib::evemu {

/// Columns of all rows, 3 rows.size() x k. Each unknown is a displacement of the ball farthest from Ball1
/// [m].
struct Added {
  Cause cause;
  std::size_t seen = 0;     ///< index of the position
  std::size_t feature = 0;  ///< index of the ball
  Eigen::MatrixXd columns;
};

/// All of one cause stand together. Empty for errors that were given without touches.
[[nodiscard]] std::vector<Added> alternative_columns(const Observations&);

/// d: of the columns [m].
[[nodiscard]] std::string text_of(const Added&, const Eigen::VectorXd& d_m, const Observations&);

}  // namespace abbe::calib::evemu

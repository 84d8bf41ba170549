#pragma once
/// Selects the rows of an Information that determine a combination of unknowns. If the data leave
/// combinations undetermined, R also has rows of rounding errors (1e-16 of the other rows), whose z
/// contain residuals. In a sum with other data these rows would count as observations.

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::joint {

/// Represents the sum of squares |A x - z|^2 + rest; A has full row rank.
struct DeterminingRows {
  Eigen::MatrixXd A;
  Eigen::VectorXd z;
  double rest = 0.0;

  [[nodiscard]] std::size_t rank() const { return static_cast<std::size_t>(A.rows()); }
};
[[nodiscard]] DeterminingRows determining_rows(const estimation::Information&);

/// Information of a part about (e, `kept`), U = N e. Effects that are not in `kept` are eliminated
/// with their prior N(0, 1). An effect in `kept` that the part does not have gets a column of
/// zeros.
[[nodiscard]] DeterminingRows in_coordinates(const estimation::Information&,
                                             std::span<const std::string> effects,
                                             const Eigen::MatrixXd& N,
                                             std::span<const std::string> kept);

}  // namespace abbe::calib::joint

#pragma once
/// The rows of an Information that determine something. Where the data leave combinations
/// undetermined, R has rows of rounding errors (1e-16 of the others), whose z contain residuals: in
/// a sum with other data these would count as observations.

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::joint {

/// |A x - z|^2 + rest, A: full row rank.
struct DeterminingRows {
  Eigen::MatrixXd A;
  Eigen::VectorXd z;
  double rest = 0.0;

  [[nodiscard]] std::size_t rank() const { return static_cast<std::size_t>(A.rows()); }
};
[[nodiscard]] DeterminingRows determining_rows(const estimation::Information&);

/// The information of a part about (e, `kept`), U = N e: effects that are not kept are eliminated
/// with their prior N(0, 1). `kept` without a column in the part has zeros.
[[nodiscard]] DeterminingRows in_coordinates(const estimation::Information&,
                                             std::span<const std::string> effects,
                                             const Eigen::MatrixXd& N,
                                             std::span<const std::string> kept);

}  // namespace abbe::calib::joint

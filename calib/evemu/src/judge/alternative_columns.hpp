#pragma once
/// The columns of the alternatives with which the errors of a ball array are compared, and the
/// texts that describe them.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "abbe/calib/evemu/judge/lack_of_fit.hpp"

namespace abbe::calib::evemu {

/// One alternative that adds columns to the design.
struct Added {
  Cause cause;
  std::size_t seen = 0;     ///< index of the position
  std::size_t feature = 0;  ///< index of the ball
};

/// Builds the columns of one alternative at a time, on request: a run of N balls has N alternatives
/// for single balls, each with 3 N x 3 columns.
class AlternativeColumns {
 public:
  explicit AlternativeColumns(const Observations&);

  /// The alternatives, grouped by cause. Empty for errors that were given without touches.
  [[nodiscard]] std::vector<std::vector<Added>> families() const;
  /// The columns of the alternative, 3 rows.size() x k. The coefficient of each column is the
  /// displacement [m] that the alternative causes at the distance of the ball farthest from Ball1.
  [[nodiscard]] Eigen::MatrixXd of(const Added&) const;

 private:
  template <class Block>
  [[nodiscard]] Eigen::MatrixXd filled(Eigen::Index columns, const Block& block) const;
  [[nodiscard]] Eigen::MatrixXd of_balls(const Added&) const;
  [[nodiscard]] Eigen::MatrixXd of_step(const Added&) const;
  [[nodiscard]] Eigen::MatrixXd by_position(Cause) const;
  [[nodiscard]] Eigen::MatrixXd of_drift() const;

  const Observations& o_;
  double arm_m_ = 0.0;
};

/// Text such as ", position 3, ball 4" for an alternative at one place, else empty.
[[nodiscard]] std::string where(const Added&, const Observations&);
/// Message to the user. d: estimated coefficients of the alternative's columns [m].
[[nodiscard]] std::string text_of(const Added&, const Eigen::VectorXd& d_m, const Observations&);

}  // namespace abbe::calib::evemu

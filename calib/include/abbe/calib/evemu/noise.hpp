#pragma once
/// How errors of balls scatter at one position: every ball has noise s, and all share that of Ball1, against
/// which they are measured: covariance s^2 (I + 1 1^T) per component, Ball1 itself exactly 0 (a ten
/// thousandth of the variance stands in for it; its rows are no observations). On top every position is
/// turned about Ball1 by a small random rotation of standard deviation w per axis.

#include <Eigen/Core>
#include <vector>

#include "abbe/calib/evemu/observe.hpp"

namespace abbe::calib::evemu {

/// Rows of one position: balls first .. first + count - 1 of Observations::rows.
struct PositionRows {
  int position = 0;
  std::size_t first = 0, count = 0;
  std::size_t ball1 = 0;  ///< index of Ball1's row
};
[[nodiscard]] std::vector<PositionRows> position_rows(const Observations&);

/// C0 of one position, count x count, in units of s^2.
[[nodiscard]] Eigen::MatrixXd ball_covariance(const PositionRows&);

/// L^-1 M with C0 = L L^T, position by position: the noise of the result is white, s^2.
[[nodiscard]] Eigen::MatrixXd whitened(const Observations&, const Eigen::MatrixXd& rows);
/// C0 M.
[[nodiscard]] Eigen::MatrixXd times_ball_covariance(const Observations&, const Eigen::MatrixXd& rows);
/// L M: noise of the right shape from white noise.
[[nodiscard]] Eigen::MatrixXd coloured(const Observations&, const Eigen::MatrixXd& rows);

/// 3 rows.size() x 3 positions: what rotations theta_p of the blocks do, -theta_p x (P - P_1).
[[nodiscard]] Eigen::MatrixXd pose_rotation_rows(const Observations&);

}  // namespace abbe::calib::evemu

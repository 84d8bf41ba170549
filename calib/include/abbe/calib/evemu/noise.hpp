#pragma once
/// How errors of balls scatter at one position: every ball has noise s, and all share that of
/// Ball1, against which they are measured: covariance s^2 (I + 1 1^T) per component, Ball1 itself
/// exactly 0 (a ten thousandth of the variance stands in for it; its rows are no observations). On
/// top every position is turned about Ball1 by a small random rotation of standard deviation w per
/// axis. Slow noise shifts all touches of a position together, by r s per coordinate (r:
/// Observations::slow_noise), and is uncorrelated over a quarter of its touches. With t_i from 0 to
/// 1 when ball i was touched, the covariance of balls i and j is
///     s^2 (1 + delta_ij + r^2 (k_ij - k_i1 - k_1j + k_11)),    k_ij = exp(-4 |t_i - t_j|).

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

/// When each ball was touched, in the order of the touches: 0 with the first ball or block of its
/// position, 1 with the last.
[[nodiscard]] std::vector<double> times_in_position(const SeenArtefact&);

/// C0 of one position, count x count, in units of s^2. Slow noise needs `seen`.
[[nodiscard]] Eigen::MatrixXd ball_covariance(const Observations&, const PositionRows&);
/// Natural logarithm of |det L|, C0 = L L^T, over the components of all balls but Ball1.
[[nodiscard]] double log_det_of_noise(const Observations&);

/// L^-1 M with C0 = L L^T, position by position: the noise of the result is white, s^2.
[[nodiscard]] Eigen::MatrixXd whitened(const Observations&, const Eigen::MatrixXd& rows);
/// C0 M.
[[nodiscard]] Eigen::MatrixXd times_ball_covariance(const Observations&,
                                                    const Eigen::MatrixXd& rows);
/// L M: noise of the right shape from white noise.
[[nodiscard]] Eigen::MatrixXd coloured(const Observations&, const Eigen::MatrixXd& rows);

/// 3 rows.size() x 3 positions: what rotations theta_p of the blocks do, -theta_p x (P - P_1).
[[nodiscard]] Eigen::MatrixXd pose_rotation_rows(const Observations&);

}  // namespace abbe::calib::evemu

#pragma once
/// Noise model of the ball errors at one position. Every ball centre has noise of standard
/// deviation s per coordinate, and all balls share the noise of Ball1, to which their errors are
/// relative: covariance s^2 (I + 1 1^T) per component. The error of Ball1 is exactly 0; its rows
/// are not observations. A ten thousandth of the variance is used for them, so that the covariance
/// is not singular. In addition every position is rotated about Ball1 by a small random rotation of
/// standard deviation w per axis.
///
/// Slow noise is common to touches that follow each other. Its standard deviation is r s per
/// coordinate (r: Observations::slow_noise); its correlation decays over a quarter of the touches
/// of a position. If ball i was touched at the relative time t_i from 0 to 1, the covariance of
/// balls i and j is
///     s^2 (1 + delta_ij + r^2 (k_ij - k_i1 - k_1j + k_11)),    k_ij = exp(-4 |t_i - t_j|).

#include <Eigen/Core>
#include <vector>

#include "abbe/calib/evemu/observe/observe.hpp"

namespace abbe::calib::evemu {

/// Rows of one position: balls first .. first + count - 1 of Observations::rows.
struct PositionRows {
  int position = 0;
  std::size_t first = 0, count = 0;
  std::size_t ball1 = 0;  ///< index of Ball1's row
};
[[nodiscard]] std::vector<PositionRows> position_rows(const Observations&);
/// The touched artefact at a position; null if only ball errors were given.
[[nodiscard]] const TouchedArtefact* touched_at(const Observations&, int position);

/// Relative time of each ball by the order of the touches: 0 for the first ball or block of its
/// position, 1 for the last.
[[nodiscard]] std::vector<double> times_in_position(const TouchedArtefact&);
/// The matrix k_ij of slow noise, balls x balls.
[[nodiscard]] Eigen::MatrixXd slow_correlation(const TouchedArtefact&);

/// Covariance C0 of one position, count x count, in units of s^2. Slow noise requires
/// Observations::seen.
[[nodiscard]] Eigen::MatrixXd ball_covariance(const Observations&, const PositionRows&);
/// Natural logarithm of |det L|, C0 = L L^T, C0: ball_covariance() of all positions, over the
/// components of all balls except Ball1.
[[nodiscard]] double log_det_of_noise(const Observations&);

/// L^-1 M for M = `rows` and ball_covariance() = C0 = L L^T, position by position: the noise of the
/// result is white, with variance s^2.
[[nodiscard]] Eigen::MatrixXd whitened(const Observations&, const Eigen::MatrixXd& rows);
/// The matrix L^T M for C0 = L L^T and M = `rows`: M^T C0 M = (L^T M)^T (L^T M).
[[nodiscard]] Eigen::MatrixXd times_noise_root(const Observations&, const Eigen::MatrixXd& rows);
/// L M, the inverse of whitened(): gives white noise M the covariance C0.
[[nodiscard]] Eigen::MatrixXd coloured(const Observations&, const Eigen::MatrixXd& rows);

/// 3 rows.size() x 3 positions: effect of a rotation theta_p of the whole artefact at position p on
/// the observed errors, -theta_p x (P - P_1), P: reading of the ball, P_1: reading of Ball1.
[[nodiscard]] Eigen::MatrixXd pose_rotation_rows(const Observations&);

}  // namespace abbe::calib::evemu

#pragma once
/// Finds the misfit (abbe/calib/model/misfit.hpp) of on-the-fly runs from their residuals.
///
/// The noise of legs that are far apart in time is independent. Errors that the model cannot
/// represent are the same whenever a leg comes to the same place. The travel of an axis is divided
/// into sections, several in each cell between two nodes. x_i = (x_i,1, x_i,2, ..): effect of the
/// tables T of this axis on row i, per unit. For each section and leg g
///     b_g = sum_i w_i x_i r_i,   n_g = sum_i w_i x_i x_i^T,   w_i = 1/sigma_i^2
/// r: residuals. With the misfit variances m_T^2, constant within a section, and the covariance C
/// of the unknowns U that the noise causes, two legs that are far apart in time have
///     E[b_g,T b_h,T] = sum_S m_S^2 n_g,TS n_h,TS - B_g,T C B_h,T^T,   B_g = sum_i w_i x_i a_i
/// a_i: row of the design matrix. Sums over the pairs of legs give the m^2 of each cell as the
/// solution of a linear system, without any assumption about the noise within a leg. The same
/// method, with the cells of the volume as sections and x_i = direction of the row, gives the
/// variances of V that depend on several axes.
///
/// Errors that depend on two axes (two_axis_errors.hpp) are subtracted before and added to u_V.
///
/// A misfit is reported if the products of its legs are significantly positive; otherwise it is
/// zero.

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/model/misfit.hpp"
#include "abbe/calib/otf/observe/observe.hpp"
#include "abbe/calib/otf/run/two_axis_errors.hpp"

namespace abbe::calib::otf {

struct ResidualsOfRun {
  const Observations& o;
  std::span<const double> residual_m;  ///< y - A U of the rows, without range offset and drift
  std::vector<std::size_t> at;         ///< indices of its unknowns among those of all runs
  /// Time over which the noise is correlated, in the unit of Observations::segment_s (segments
  /// without times: 1).
  double correlation_time = 0.0;
  std::optional<TwoAxisErrors> two_axes{};  ///< already subtracted from the residuals
};

struct FoundMisfit {
  Misfit misfit;
  /// Root of the part of the covariance of the unknowns that the misfit causes: root root^T.
  Eigen::MatrixXd root_of_covariance;
  /// Texts about the misfit, and possible measures against it.
  std::vector<std::string> notes;
};

/// Finds the misfit. All runs have the tables of the first run. `of_noise`: covariance of the
/// unknowns that is caused by the noise of the rows; `Q`: cofactor matrix of their adjustment with
/// the weights 1/sigma^2. nullopt without a misfit.
[[nodiscard]] std::optional<FoundMisfit> find_misfit(std::span<const ResidualsOfRun> runs,
                                                     const Eigen::MatrixXd& of_noise,
                                                     const Eigen::MatrixXd& Q);

}  // namespace abbe::calib::otf

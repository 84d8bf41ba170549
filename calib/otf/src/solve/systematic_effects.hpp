#pragma once
/// Effects that are common to all rows of a run: offset and scale of the ranges, scales of the
/// axes, errors of the machine that depend on two axes.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/otf/solve/solve.hpp"
#include "solve/whitened_rows.hpp"

namespace abbe::calib::otf {

/// The estimate with additional unknowns: the range offset, if it has a prior, and the errors of
/// two axes, if they are significant.
struct WithRunEffects {
  RangeOffset offset;
  std::optional<TwoAxisErrors> two_axes;
  Eigen::VectorXd U;
  Eigen::MatrixXd root_of_covariance;  ///< root of the covariance of U that these effects cause:
                                       ///< root root^T
  std::vector<double> residual_m;      ///< residuals of the rows after subtraction of these effects
  std::optional<OffsetInModel> in_model;
};
/// Computes the estimate. `a`: adjustment of `rows`; `residual_m`: y - A U of the original rows of
/// the observations; `factor`: variance of the rows relative to the stated variance.
[[nodiscard]] WithRunEffects with_run_effects(const Observations&, const WhitenedRows& rows,
                                              const Adjustment& a,
                                              std::span<const double> residual_m, double factor);

/// The observations after subtraction of the errors of two axes.
[[nodiscard]] Observations without_two_axis_errors(Observations, const TwoAxisErrors&);

/// Derivative of g = A^T W^2 y by a relative change of all ranges; U changes by Q g. The change
/// displaces each point by its vector from the tracker. The part of this vector that is common to
/// all points changes only the rigid unknowns.
[[nodiscard]] Eigen::VectorXd dg_drange_scale(const Observations&, const WhitenedRows& rows);
/// Derivative of U by a relative change of the scale of an axis: the positioning table of the axis
/// has slope 1 and is zero at the reference.
[[nodiscard]] Eigen::VectorXd dU_daxis_scale(const Observations&, Axis);

/// Adds the effect of Noise::u_scale and u_axis_scale to the covariance of U. `Q`: cofactor matrix
/// of the adjustment of `rows`.
void add_scale_effects(Eigen::MatrixXd& covariance, const Observations&, const WhitenedRows& rows,
                       const Eigen::MatrixXd& Q);

}  // namespace abbe::calib::otf

#pragma once
/// Effects that all rows of a run have in common: an offset and a scale of the ranges, the scales
/// of the axes, errors of the machine that depend on two axes at once.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/otf/solve/solve.hpp"
#include "solve/whitened_rows.hpp"

namespace abbe::calib::otf {

/// The estimate in which the range offset, if it has a prior, and the errors of two axes, if the
/// rows show them, are further unknowns.
struct WithRunEffects {
  RangeOffset offset;
  std::optional<TwoAxisErrors> two_axes;
  Eigen::VectorXd U;
  Eigen::MatrixXd root_of_covariance;  ///< what they add to that of U: root root^T
  std::vector<double> residual_m;      ///< of the rows without them
  std::optional<OffsetInModel> in_model;
};
/// `a`: adjustment of `rows`, `residual_m`: y - A U of the observations' own rows, `factor`:
/// variance of the rows relative to the stated one.
[[nodiscard]] WithRunEffects with_run_effects(const Observations&, const WhitenedRows& rows,
                                              const Adjustment& a,
                                              std::span<const double> residual_m, double factor);

/// The observations without the errors of two axes.
[[nodiscard]] Observations without_two_axis_errors(Observations, const TwoAxisErrors&);

/// Change of g = A^T W^2 y per relative change of all ranges, which displaces a point by its vector
/// from the tracker: U changes by Q g. The part of this vector that is the same for all points
/// changes only the rigid unknowns.
[[nodiscard]] Eigen::VectorXd dg_drange_scale(const Observations&, const WhitenedRows& rows);
/// Change of U per relative change of the scale of an axis: its positioning table changes with
/// slope 1 and is zero at the reference.
[[nodiscard]] Eigen::VectorXd dU_daxis_scale(const Observations&, Axis);

/// Adds the effect of Noise::u_scale and u_axis_scale to the covariance of U. `Q`: of the
/// adjustment of `rows`.
void add_scale_effects(Eigen::MatrixXd& covariance, const Observations&, const WhitenedRows& rows,
                       const Eigen::MatrixXd& Q);

}  // namespace abbe::calib::otf

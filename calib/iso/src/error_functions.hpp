#pragma once
/// Value and uncertainty of linear functions of the parameters of a model.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "abbe/calib/iso/standard_values.hpp"

namespace abbe::calib::iso {

/// Linear functions of the parameters of a model, with value and uncertainty. Refers to the model,
/// which must outlive it. All uncertainties include the misfit of the model (misfit.hpp). The
/// misfit of a table is an additional independent error of each node; the misfit of V is one error
/// of each component in each cell of the volume.
class ErrorFunctions {
 public:
  explicit ErrorFunctions(const VolumetricModel&);

  [[nodiscard]] const VolumetricModel& model() const { return *model_; }
  [[nodiscard]] bool has_travel() const { return model_->travel() != nullptr; }
  /// Row a: a U is the component of V along the unit vector `along`. U contains the parameters,
  /// then the differences between the directions of travel, then (with a misfit of V) this misfit,
  /// whose value is 0. For an axis with an unknown direction: the mean of both.
  [[nodiscard]] Eigen::RowVectorXd row(const Vector3& q_m, const Vector3& along,
                                       const AxisTravel& travel = {}) const;
  /// Row a: a U is the value of the table at a position of its axis.
  [[nodiscard]] Eigen::RowVectorXd table_row(const Table&, double position_m) const;
  [[nodiscard]] double value(const Eigen::RowVectorXd& row) const { return row.dot(U_); }
  [[nodiscard]] Value with_u(const Eigen::RowVectorXd& row) const;
  /// Variance of each row times U.
  [[nodiscard]] Eigen::VectorXd variances(const Eigen::MatrixXd& rows) const {
    return (rows * covariance_).cwiseProduct(rows).rowwise().sum();
  }
  /// True if `rows` depend on a difference between the directions of travel that the measurement
  /// does not determine (only its prior is known).
  [[nodiscard]] bool has_undetermined_travel(const Eigen::MatrixXd& rows) const;
  /// Errors drawn from the covariance of the parameters: parameters x draws. The opposite of each
  /// draw is equally probable.
  [[nodiscard]] const Eigen::MatrixXd& drawn_errors() const { return drawn_errors_; }

 private:
  void add_misfit();
  /// Index of the first of the three unknowns of the misfit of V at an axis position.
  [[nodiscard]] Eigen::Index misfit_at(const Vector3& q_m) const;

  const VolumetricModel* model_;
  Eigen::Index misfit_ = -1;  ///< index of the first unknown of the misfit of V; -1: none
  Vector3 low_m_ = Vector3::Zero(), cell_m_ = Vector3::Ones();
  Eigen::VectorXd U_;
  Eigen::MatrixXd covariance_;
  Eigen::MatrixXd drawn_errors_;
  std::vector<bool> undetermined_;  ///< for each parameter
};

/// The vector c y of excess_of(): the values reduced to their size without noise.
[[nodiscard]] inline Eigen::VectorXd true_size_of(const Eigen::VectorXd& y,
                                                  const Eigen::MatrixXd& e) {
  const double noise = e.squaredNorm() / static_cast<double>(e.cols()), size = y.squaredNorm();
  return (size > noise ? std::sqrt(1.0 - noise / size) : 0.0) * y;
}

/// Mean increase of the statistic s of values by noise:
///     b = max(0, mean over drawn e of s(c y + e) - s(c y)),  c^2 = max(0, 1 - E|e|^2 / |y|^2)
/// y: estimated values, e: a drawn error or its opposite. c y has the size of the true values,
/// because |y|^2 is |true y|^2 + E|e|^2 on average. `e`: values x draws.
template <class Statistic>
[[nodiscard]] double excess_of(const Eigen::VectorXd& y, const Eigen::MatrixXd& e,
                               const Statistic& s) {
  const Eigen::VectorXd true_y = true_size_of(y, e);
  double sum = 0.0;
  for (Eigen::Index k = 0; k < e.cols(); ++k) {
    sum += s(true_y + e.col(k)) + s(true_y - e.col(k));
  }
  return std::max(0.0, sum / (2.0 * static_cast<double>(e.cols())) - s(true_y));
}

/// Standard uncertainty of a statistic s of the values y, for example of a range. l is a linear
/// function of the values with l = s(y) at the estimate (for a range: the difference between the
/// positions of the largest and the smallest value), u_l its standard uncertainty.
///     u^2 = u_l^2 + max(b^2, mean over drawn e of (s(c y + e) - s(c y))^2 - (l e)^2)
/// b, c, e: see excess_of(). If no e changes which values are the largest and the smallest, s is l,
/// and the second term is 0. Otherwise other positions contribute their uncertainty, too: the true
/// largest value may be at a position whose value is not well known. `l`: l e for each column of
/// `e`.
template <class Statistic>
[[nodiscard]] double u_of(double u_l, const Eigen::VectorXd& y, const Eigen::MatrixXd& e,
                          const Eigen::RowVectorXd& l, const Statistic& s) {
  const Eigen::VectorXd true_y = true_size_of(y, e);
  const double s_true = s(true_y);
  double squares = 0.0;
  for (Eigen::Index k = 0; k < e.cols(); ++k) {
    const double up = s(true_y + e.col(k)) - s_true, down = s(true_y - e.col(k)) - s_true;
    squares += 0.5 * (up * up + down * down) - l(k) * l(k);
  }
  const double b = excess_of(y, e, s);
  return std::sqrt(u_l * u_l + std::max(b * b, squares / static_cast<double>(e.cols())));
}

/// Range: the largest minus the smallest a U over the rows a. Requires at least one row.
[[nodiscard]] Value range_of(const ErrorFunctions&, const Eigen::MatrixXd& rows);
/// The a U with the largest |a U| over the rows a.
[[nodiscard]] Value largest_of(const ErrorFunctions&, const Eigen::MatrixXd& rows);

/// Systematic deviation E and reversal error B of positions that are approached in both directions
/// [ISO 230-2].
struct Bidirectional {
  Value E, B;
};
/// Computes E and B. nullopt if the measurement does not determine the difference between the
/// directions.
[[nodiscard]] std::optional<Bidirectional> bidirectional_of(const ErrorFunctions&,
                                                            const Eigen::MatrixXd& up,
                                                            const Eigen::MatrixXd& down);

}  // namespace abbe::calib::iso

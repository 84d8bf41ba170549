#pragma once
/// Linear functions of the parameters of a model, with value and uncertainty.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "abbe/calib/iso/standard_values.hpp"

namespace abbe::calib::iso {

/// Refers to the model and must not outlive it.
class ErrorFunctions {
 public:
  explicit ErrorFunctions(const VolumetricModel&);

  [[nodiscard]] const VolumetricModel& model() const { return *model_; }
  [[nodiscard]] bool has_travel() const { return model_->travel() != nullptr; }
  /// Row a such that a U is the component of V along the unit vector `along`, U: the parameters,
  /// followed by the differences between the directions of travel. With an unknown direction of an
  /// axis: the mean of both.
  [[nodiscard]] Eigen::RowVectorXd row(const Vector3& q_m, const Vector3& along,
                                       const estimation::AxisTravel& travel = {}) const;
  /// Row of a table at a position of its axis.
  [[nodiscard]] Eigen::RowVectorXd table_row(const Table&, double position_m) const;
  [[nodiscard]] double value(const Eigen::RowVectorXd& row) const { return row.dot(U_); }
  [[nodiscard]] Value with_u(const Eigen::RowVectorXd& row) const;
  /// A difference between the directions of travel that has an effect in `rows` is not determined by
  /// the measurement: only its prior is known.
  [[nodiscard]] bool has_undetermined_travel(const Eigen::MatrixXd& rows) const;
  /// Errors of the parameters as their covariance has them: parameters x draws. The opposite of each
  /// is as probable.
  [[nodiscard]] const Eigen::MatrixXd& drawn_errors() const { return drawn_errors_; }

 private:
  const VolumetricModel* model_;
  Eigen::VectorXd U_;
  Eigen::MatrixXd covariance_;
  Eigen::MatrixXd drawn_errors_;
  std::vector<bool> undetermined_;  ///< of each parameter
};

/// By how much noise raises the statistic s of values on average:
///     b = max(0, mean over drawn e of s(c y + e) - s(c y)),  c^2 = max(0, 1 - E|e|^2 / |y|^2)
/// y: estimated values, e: a drawn error or its opposite, c y: values of the size that the true ones
/// have, since |y|^2 is |true y|^2 + E|e|^2 on average. `e`: values x draws.
template <class Statistic>
[[nodiscard]] double excess_of(const Eigen::VectorXd& y, const Eigen::MatrixXd& e,
                               const Statistic& s) {
  const double noise = e.squaredNorm() / static_cast<double>(e.cols()), size = y.squaredNorm();
  const Eigen::VectorXd true_y = (size > noise ? std::sqrt(1.0 - noise / size) : 0.0) * y;
  double sum = 0.0;
  for (Eigen::Index k = 0; k < e.cols(); ++k) {
    sum += s(true_y + e.col(k)) + s(true_y - e.col(k));
  }
  return std::max(0.0, sum / (2.0 * static_cast<double>(e.cols())) - s(true_y));
}

/// The largest minus the smallest of a U over the rows a. Requires at least one row.
[[nodiscard]] Value range_of(const ErrorFunctions&, const Eigen::MatrixXd& rows);
/// The a U with the largest |a U|.
[[nodiscard]] Value largest_of(const ErrorFunctions&, const Eigen::MatrixXd& rows);

/// Systematic deviation E and reversal B of the same positions, approached in both directions
/// [ISO 230-2].
struct Bidirectional {
  Value E, B;
};
/// None if the measurement does not determine the difference between the directions.
[[nodiscard]] std::optional<Bidirectional> bidirectional_of(const ErrorFunctions&,
                                                            const Eigen::MatrixXd& up,
                                                            const Eigen::MatrixXd& down);

}  // namespace abbe::calib::iso

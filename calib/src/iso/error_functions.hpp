#pragma once
/// Linear functions of the parameters of a model, with value and uncertainty.

#include <Eigen/Core>

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

 private:
  const VolumetricModel* model_;
  Eigen::VectorXd U_;
  Eigen::MatrixXd covariance_;
};

/// The largest minus the smallest of a U over the rows a. Requires at least one row.
[[nodiscard]] Value range_of(const ErrorFunctions&, const Eigen::MatrixXd& rows);
/// The a U with the largest |a U|.
[[nodiscard]] Value largest_of(const ErrorFunctions&, const Eigen::MatrixXd& rows);

}  // namespace abbe::calib::iso

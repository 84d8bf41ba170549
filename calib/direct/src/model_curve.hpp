#pragma once
/// One error motion of a model as a function of the position of its axis.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib::direct {

/// Rows A such that A * U is the component of V of a translation error along its axis, on the line
/// through line_m.
[[nodiscard]] Eigen::MatrixXd rows_along(const TableBasis&, const Vector3& tool_m,
                                         ErrorMotion translation, const Vector3& line_m,
                                         std::span<const double> positions_m);

/// Refers to the model and must not outlive it.
class ModelCurve {
 public:
  /// `line_m`: see MeasuredError; it changes translations only. The model has the table of
  /// `motion`.
  ModelCurve(const VolumetricModel& model, ErrorMotion motion,
             const std::optional<Vector3>& line_m = std::nullopt);

  [[nodiscard]] ErrorMotion motion() const { return motion_; }
  [[nodiscard]] const AxisNodes& nodes() const;
  /// Within the nodes, with a tolerance of 1 um for readings at the end of the travel.
  [[nodiscard]] bool covers(double position_m) const;
  /// values(p) = rows(p) * U of the model.
  [[nodiscard]] Eigen::MatrixXd rows(std::span<const double> positions_m) const;
  [[nodiscard]] Eigen::VectorXd values(std::span<const double> positions_m) const;
  /// Of rows B of values().
  [[nodiscard]] Eigen::MatrixXd covariance(const Eigen::MatrixXd& B) const {
    return B * model_->covariance() * B.transpose();
  }
  /// The table of another motion of the same axis; nullopt if the model does not have it.
  [[nodiscard]] std::optional<ModelCurve> of_same_axis(Motion) const;

 private:
  const VolumetricModel* model_;
  ErrorMotion motion_;
  std::optional<Vector3> line_m_;
};

}  // namespace abbe::calib::direct

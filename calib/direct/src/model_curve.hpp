#pragma once
/// One error motion of a model as a function of the position of its axis.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib::direct {

/// Matrix A with one row per position: A * U is the component of V in the direction of the
/// translation error, along its axis on the line through line_m.
[[nodiscard]] Eigen::MatrixXd rows_along(const TableBasis&, const Vector3& tool_m,
                                         ErrorMotion translation, const Vector3& line_m,
                                         std::span<const double> positions_m);

/// Values and covariance of one error motion. Refers to the model, which must outlive it.
class ModelCurve {
 public:
  /// `line_m`: see MeasuredError; it changes translations only. The model must have the table of
  /// `motion`.
  ModelCurve(const VolumetricModel& model, ErrorMotion motion,
             const std::optional<Vector3>& line_m = std::nullopt);

  [[nodiscard]] ErrorMotion motion() const { return motion_; }
  [[nodiscard]] const AxisNodes& nodes() const;
  /// True within the nodes, with a tolerance of 1 um for readings at the end of the travel.
  [[nodiscard]] bool covers(double position_m) const;
  /// Matrix with one row per position: values(p) = rows(p) * U, U: parameters of the model.
  [[nodiscard]] Eigen::MatrixXd rows(std::span<const double> positions_m) const;
  [[nodiscard]] Eigen::VectorXd values(std::span<const double> positions_m) const;
  /// Covariance of B * U, for example with B = rows(p).
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

#pragma once
/// Expresses measured errors and a model as parameters of the same tables on the same nodes; see
/// abbe/calib/direct/volume.hpp.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/direct/volume.hpp"

namespace abbe::calib::direct {

/// A measured error for which the model has a table or squareness.
struct UsedError {
  const MeasuredError* error;
  std::optional<ErrorMotion> motion;  // nullopt: squareness
  Runs runs;                          // at positions within the nodes of the model
  Runs all;
};
struct UsableErrors {
  std::vector<UsedError> used;
  std::vector<LeftOut> left_out;  // errors that the model has and that cannot be used
};
/// Divides the measured errors. Used: errors with at least three positions within the nodes of the
/// model, and every squareness.
[[nodiscard]] Result<UsableErrors> usable_errors(std::span<const MeasuredError>,
                                                 const VolumetricModel&);
/// Leaves out each squareness that cannot be compared on the common nodes.
void leave_out_squareness(UsableErrors&, const ParameterLayout&);
/// Layout of the tables of the used errors, on the nodes that they have in common.
[[nodiscard]] Result<ParameterLayout> common_layout(const std::vector<UsedError>&,
                                                    const VolumetricModel&);

/// Parameters U of the common layout with their covariance, in datum G2.
struct TableValues {
  Eigen::VectorXd U;
  Eigen::MatrixXd cov_U;
};
struct CommonValues {
  TableValues measured, model;
};
[[nodiscard]] CommonValues common_values(const std::vector<UsedError>&, const ParameterLayout&,
                                         const VolumetricModel&, const DeviceUncertainty&);

}  // namespace abbe::calib::direct

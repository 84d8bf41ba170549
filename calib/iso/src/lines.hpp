#pragma once
/// The lines along which standard values are computed.

#include "error_functions.hpp"

namespace abbe::calib::iso {

/// The line along one axis through the centre of the box.
struct AxisLine {
  Axis axis = Axis::X;
  Vector3 through_m = Vector3::Zero();
  std::vector<double> targets_m;

  /// Rows of one component of V at the targets (ErrorFunctions::row()).
  [[nodiscard]] Eigen::MatrixXd rows(const ErrorFunctions&, std::size_t component,
                                     Travel = Travel::Unknown) const;
};
[[nodiscard]] AxisLine line_of(const VolumetricModel&, const LineBox&, Axis);

/// The four body diagonals, in the order PPP, NPP, PNP, NNP.
[[nodiscard]] std::array<Diagonal, 4> diagonals_of(const ErrorFunctions&, const LineBox&);

}  // namespace abbe::calib::iso

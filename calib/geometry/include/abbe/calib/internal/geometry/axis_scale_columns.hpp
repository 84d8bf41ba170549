#pragma once
/// Effect of length errors of the scales on a model with tables.

#include <Eigen/Dense>

#include "abbe/calib/geometry/parameter_layout.hpp"

namespace abbe::calib {

/// Effect of a relative change of the scale (length error) of each axis on the parameters of a
/// model with tables: the positioning table has slope 1 and is zero at the reference. One column
/// each for X, Y, Z.
[[nodiscard]] Eigen::MatrixX3d axis_scale_columns(const ParameterLayout&);

}  // namespace abbe::calib

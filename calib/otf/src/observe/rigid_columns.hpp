#pragma once
/// Columns of the rigid unknowns of the tracker station.

#include <cstddef>

#include "abbe/calib/geometry/model_columns.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::otf {

/// Appends the columns of the six rigid unknowns T and r of the tracker station for a target at p
/// (axis position + target offset, m): measured error = V + T + r x p. `first`: index of tx.
inline void append_rigid_columns(ModelColumns& columns, std::size_t first, const Vector3& p_m) {
  const Matrix3 rotation = rotation_effect(p_m);
  for (Eigen::Index k = 0; k < 3; ++k) {
    columns.push(first++, Vector3::Unit(k));
  }
  for (Eigen::Index k = 0; k < 3; ++k) {
    columns.push(first++, rotation.col(k));
  }
}

}  // namespace abbe::calib::otf

#pragma once
/// The linear rigid-body model V = M B U of a machine with three linear axes ([Sanders 2023]
/// eq. (6) and its reference 14). U: parameters (parameter_layout.hpp), B U: errors of the axes
/// interpolated between nodes (linear_interpolation.hpp), M: their effect on the target. That is
///     V(q) = sum_a [ d_a(q_a) + eps_a(q_a) x l_a(q) ] + (-EC0Y (y - y0) + EB0Z (z - z0),
///                                                        -EA0Z (z - z0), 0)
///     l_a(q) = t + sum of q_b e_b over the axes b nearer to the tool than a
/// (x0, y0, z0): ParameterLayout::squareness_from_m(), q = (x, y, z): axis position, t: target
/// offset, d_a and eps_a: translation and rotation errors of axis a, l_a: lever of axis a, e_b:
/// unit vector of axis b. The travel of an axis is not part of its own lever. The linearisation
/// error against the exact product of transforms is of second order: 0.015 um on average for a mean
/// error of 103 um.

#include <array>
#include <cstddef>
#include <span>

#include "abbe/calib/geometry/model_columns.hpp"
#include "abbe/calib/geometry/parameter_layout.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

/// The non-zero columns of M B at one axis position, sorted by parameter index. No allocation.
struct DesignColumns {
  static constexpr std::size_t kCapacity = 18 * 2 + 3 + 6;
  std::array<Column, kCapacity> column;
  std::size_t count = 0;
  [[nodiscard]] std::span<const Column> span() const { return {column.data(), count}; }
};

/// Lever l_a of axis `a` [m].
[[nodiscard]] Vector3 lever(const KinematicChain&, Axis a, const Vector3& axis_position_m,
                            const Vector3& target_offset_m);

/// Columns of the table and squareness parameters.
[[nodiscard]] DesignColumns design_columns(const ParameterLayout&, const Vector3& axis_position_m,
                                           const Vector3& target_offset_m);

/// As design_columns(), followed by the columns of the rigid unknowns T and r:
///     measured error = V + T + r x p,   p = axis position + target offset.
[[nodiscard]] DesignColumns design_columns_with_rigid(const ParameterLayout&,
                                                      const Vector3& axis_position_m,
                                                      const Vector3& target_offset_m);

/// V = M B U. `U` has at least model_size() entries; further entries are ignored.
[[nodiscard]] Vector3 volumetric_error(const ParameterLayout&, std::span<const double> U,
                                       const Vector3& axis_position_m,
                                       const Vector3& target_offset_m);

}  // namespace abbe::calib

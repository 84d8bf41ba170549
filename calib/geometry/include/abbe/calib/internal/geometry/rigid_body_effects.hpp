#pragma once
/// The matrix M of V = M B U (rigid_body_model.hpp): displacement of the target per unit of each
/// error motion.

#include <array>

#include "abbe/calib/geometry/error_parameters.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

/// Levers of X, Y, Z in m: from each axis to the target (l_a in rigid_body_model.hpp). q: axis
/// position, t: target offset.
[[nodiscard]] inline std::array<Vector3, 3> levers_m(const KinematicChain& chain, const Vector3& q,
                                                     const Vector3& t) {
  std::array<Vector3, 3> levers;
  Vector3 l = t;
  const std::array<Axis, 3>& order = chain.order_w_to_t();
  for (std::size_t i = 3; i-- > 0;) {
    const std::size_t a = index(order[i]);
    const auto k = static_cast<Eigen::Index>(a);
    levers[a] = l;
    l(k) += q(k);
  }
  return levers;
}

/// Displacement of the target per unit of an error: the unit vector for a translation, its cross
/// product with the lever for a rotation.
[[nodiscard]] inline Vector3 effect(ErrorMotion e, const Vector3& lever_m) {
  const Vector3 unit = Vector3::Unit(static_cast<Eigen::Index>(direction(e.motion)));
  return is_rotation(e.motion) ? Vector3(unit.cross(lever_m)) : unit;
}

/// Displacements per unit of the squareness errors EA0Z, EB0Z, EC0Y. A squareness error tilts only
/// the direction of motion, so that the lever has no effect.
[[nodiscard]] inline std::array<Vector3, 3> squareness_effects(const Vector3& q) {
  return {Vector3(0, -q.z(), 0), Vector3(q.z(), 0, 0), Vector3(-q.y(), 0, 0)};
}

}  // namespace abbe::calib

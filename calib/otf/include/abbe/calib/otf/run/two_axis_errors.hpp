#pragma once
/// Errors of the machine that depend on two axes at once: a column that tilts under a saddle, a bed
/// that bends under a moving load. Tables cannot represent these errors. Tables, tracker pose and
/// range offset follow a part of them, which makes the model wrong. The errors are
///     V_c(q) = sum over pairs (a, b) of axes of D_c,ab s_a s_b,   s_a = (q_a - middle_a) / half_a
/// c = x, y, z; middle_a, half_a: of the travel, so that D is the error at a corner. D is a random
/// effect N(0, s^2). s is that of the largest marginal likelihood; D counts as zero if this
/// likelihood does not exceed that of s = 0 beyond chance. The model does not contain these errors:
/// they are misfit (abbe/calib/model/misfit.hpp). They are not searched in runs with several
/// targets, nor in runs with reference nests, where the estimated drift would follow them.

#include <array>

#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::otf {

inline constexpr std::size_t kTwoAxisErrors = 9;

struct TwoAxisErrors {
  /// D with its standard uncertainty, in the order of components within pairs: x, y, z of pair X Y,
  /// then of Y Z, then of Z X.
  std::array<double, kTwoAxisErrors> D_m{}, u_m{};

  /// Products s_a s_b of the pairs X Y, Y Z, Z X.
  [[nodiscard]] static Vector3 products(const MachineNodes&, const Vector3& q_m);
  [[nodiscard]] Vector3 V_m(const MachineNodes&, const Vector3& q_m) const;
  /// rms of each component of V over the volume; includes the uncertainty u_m.
  [[nodiscard]] Vector3 rms_m() const;
};

}  // namespace abbe::calib::otf

#pragma once
/// The path coordinate system of one point and the standard uncertainties along its axes, from
/// [Sanders 2023] eq. (1) and (4). b: unit vector of the beam, a1, a2, a3: axes of the system.
/// Corrections to the paper:
/// - eq. (1) subtracts the scalar b.a1 from a vector; here (b.a1) a1 is subtracted,
/// - eq. (4) contains the path direction d, for which a2.d = a3.d = 0; here the beam b is used,
/// - U_radial in eq. (4) is a length: sigma_angle * range.

#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// Unit vectors in machine coordinates: a1 along the path, a2 perpendicular to a1 in the plane of
/// a1 and the beam, a3 = a1 x a2.
struct PathFrame {
  Vector3 a1, a2, a3;
  double sigma2_m = 0.0;  ///< standard uncertainty of one sample along a2
  double sigma3_m = 0.0;  ///< standard uncertainty along a3, which is perpendicular to the beam
};

/// `beam_m`: vector from the tracker to the point in machine coordinates, not zero.
[[nodiscard]] PathFrame path_frame(const Vector3& direction, const Vector3& beam_m, const Noise&);

}  // namespace abbe::calib::otf

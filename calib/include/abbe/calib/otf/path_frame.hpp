#pragma once
/// The path coordinate system of one point and the standard uncertainties along it. [Sanders 2023]
/// eq. (1) and (4), both corrected: eq. (1) subtracts the scalar b.a1 from a vector (meant: (b.a1)
/// a1), eq. (4) has the path direction d where the beam b belongs (a2.d = a3.d = 0 always), its
/// U_radial is a length: sigma_angle * range.

#include "abbe/calib/otf/run.hpp"

namespace abbe::calib::otf {

/// a1 along the path, a2 as much along the beam as possible, a3 = a1 x a2; unit vectors in machine
/// coordinates.
struct PathFrame {
  Vector3 a1, a2, a3;
  double sigma2_m = 0.0;  ///< standard uncertainty of one sample along a2
  double sigma3_m = 0.0;  ///< along a3, perpendicular to the beam
};

/// `beam_m` from the tracker to the point, machine coordinates, not zero.
[[nodiscard]] PathFrame path_frame(const Vector3& direction, const Vector3& beam_m, const Noise&);

/// Covariance of one sample in the tracker frame: sigma_r^2 er er^T + (sigma_a r)^2 (I - er er^T).
/// [Sanders 2023] eq. (8) to (10) with angles where eq. (8) has lengths: diag(sigma_r^2,
/// (sigma_a / cos el)^2, sigma_a^2) through the Jacobian gives the same.
[[nodiscard]] Matrix3 sample_covariance_m2(const Vector3& p_tracker_m, const Noise&);

}  // namespace abbe::calib::otf

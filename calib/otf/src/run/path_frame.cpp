#include "abbe/calib/otf/run/path_frame.hpp"

#include <cmath>

namespace abbe::calib::otf {
namespace {

/// Component of `v` perpendicular to the unit vector `a1`.
Vector3 perpendicular_part(const Vector3& v, const Vector3& a1) {
  return v - v.dot(a1) * a1;
}

Vector3 least_parallel_axis(const Vector3& a1) {
  Eigen::Index k = 0;
  a1.cwiseAbs().minCoeff(&k);
  return Vector3::Unit(k);
}

}  // namespace

PathFrame path_frame(const Vector3& direction, const Vector3& beam_m, const Noise& noise) {
  const double range_m = beam_m.norm();
  const Vector3 b = beam_m / range_m;
  PathFrame frame;
  frame.a1 = direction.normalized();
  Vector3 across = perpendicular_part(b, frame.a1);

  // If the path is parallel to the beam, all directions perpendicular to it have the same
  // uncertainty, and any of them can be a2.
  constexpr double kAlongBeam = 1e-6;
  if (across.norm() < kAlongBeam) {
    across = perpendicular_part(least_parallel_axis(frame.a1), frame.a1);
  }

  frame.a2 = across.normalized();
  frame.a3 = frame.a1.cross(frame.a2);
  const double across_beam_m = noise.sigma_angle_rad * range_m;
  const double cosine = frame.a2.dot(b);
  frame.sigma2_m = std::sqrt(noise.sigma_range_m * noise.sigma_range_m * cosine * cosine +
                             across_beam_m * across_beam_m * (1.0 - cosine * cosine));
  frame.sigma3_m = across_beam_m;

  return frame;
}

}  // namespace abbe::calib::otf

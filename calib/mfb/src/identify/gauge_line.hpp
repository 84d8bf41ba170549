#pragma once
/// Positioning of a measuring machine from a step gauge. The faces are planes across the gauge.
/// With the gauge along the unit vector g, and the tip at c_k on face k with calibrated distance
/// d_k,
///     g . (c_k - c_0) = d_k (1 + alpha dT),   E_k = d_k (1 + alpha dT) - v . (c_k - c_0)
/// at whatever place the tip touches a face. v is the direction of the line through the touches. It
/// replaces g, which the touches do not determine. The angle e between both has two components of
/// standard uncertainty u:
///     v . (c_k - c_0) - d_k = e . w_k + d_k e^2 / 2
/// w_k: distance of touch k from the line. e^2 / 2 has the expectation u^2 and the standard
/// deviation u^2: sqrt(2) u^2 about 0. If the gauge lies along the bar instead, e is the angle phi
/// between bar and line: phi^2 / 2 is a contribution, too.

#include <Eigen/Core>

#include "abbe/calib/mfb/identify/bar_calibration.hpp"
#include "identify/bar_line.hpp"

namespace abbe::calib::mfb {

/// The touches of all faces, means of the runs, and the line through them.
struct GaugeLine {
  std::vector<Vector3> face_m;           ///< readings of the axes, mean for each face
  Vector3 middle_m = Vector3::Zero();    ///< centre of the tip, mean of the faces, machine axes
  Vector3 direction = Vector3::UnitX();  ///< unit vector towards larger distances
  double s_m = 0.0;  ///< standard deviation of one reading along the line; 0 without repeats
  /// Distance of a face along the line from the first one.
  [[nodiscard]] double measured_m(std::size_t face) const {
    return direction.dot(face_m[face] - face_m[0]);
  }
};

/// Computes the line. BadInput: invalid values of the gauge, a face whose readings do not fit its
/// distance, a reading far from the other runs of its face.
[[nodiscard]] Result<GaugeLine> line_of_gauge(const StepGauge& gauge);

/// Standard uncertainty of each of the two angles between the gauge and the line of its touches.
[[nodiscard]] double u_of_alignment(const StepGauge& gauge);

/// Largest permitted angle between the line of the touches and the bar: three times the combined
/// standard uncertainty of the directions of gauge and bar.
[[nodiscard]] double most_angle_rad(const StepGauge& gauge, const BarLine& bar);

/// Returns BadInput if the angle between the line of the touches and the bar exceeds
/// most_angle_rad().
[[nodiscard]] Result<void> check_alignment(const StepGauge& gauge, const GaugeLine& line,
                                           const BarLine& bar);

/// E_XX at the holes of the bar relative to the first hole.
struct Positioning {
  Eigen::VectorXd E_m;
  /// covariance of E_m by calibration, alignment, temperature and repeatability of the gauge
  Eigen::MatrixXd covariance_m2;
  std::vector<std::string> notes;  ///< faces that do not fit the other faces
};

/// Computes E_XX. BadInput: holes beyond the first or last face.
[[nodiscard]] Result<Positioning> positioning_by_gauge(const StepGauge& gauge,
                                                       const GaugeLine& line, const BarLine& bar);

/// Covariance of the Abbe error at points along the bar. The rotation of the machine relative to
/// the first point is taken as a random function: far from the first point it has the standard
/// uncertainty u, and the rotations at two points have the correlation exp(-distance / (length /
/// 4)).
[[nodiscard]] Eigen::MatrixXd abbe_covariance_m2(double beside_m, double u_rotation_rad,
                                                 std::span<const double> along_m);

}  // namespace abbe::calib::mfb

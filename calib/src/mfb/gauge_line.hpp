#pragma once
/// Positioning of a measuring machine from a step gauge.

#include <Eigen/Core>

#include "abbe/calib/mfb/bar_calibration.hpp"

namespace abbe::calib::mfb {

/// Machine axis along the bar, and whether the bar points to larger (1) or smaller (-1) readings.
struct AlongBar {
  Eigen::Index axis = 0;
  double sign = 1.0;
  [[nodiscard]] double of(const Vector3& v) const { return sign * v(axis); }
  [[nodiscard]] double of(double reading_m) const { return sign * reading_m; }
};

/// E_XX at points along the bar relative to the first point.
struct Positioning {
  Eigen::VectorXd E_m;
  Eigen::MatrixXd covariance_m2;  ///< of calibration, temperature and repeatability of the gauge
};

/// `along_m`: readings along the bar at the points, ascending. BadInput: invalid values of the gauge,
/// a face whose readings do not fit its distance, or points beyond the first or last face.
[[nodiscard]] Result<Positioning> positioning_by_gauge(const StepGauge& gauge,
                                                       const AlongBar& direction,
                                                       std::span<const double> along_m);

/// Covariance of the Abbe error at points along the bar: the rotation of the machine relative to
/// the first point is a random function with the standard uncertainty u far from it, and the
/// correlation exp(-distance / (length / 4)) of its absolute value.
[[nodiscard]] Eigen::MatrixXd abbe_covariance_m2(double beside_m, double u_rotation_rad,
                                                 std::span<const double> along_m);

}  // namespace abbe::calib::mfb

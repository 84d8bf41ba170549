#pragma once
/// Positioning of a measuring machine from a step gauge.

#include <Eigen/Core>

#include "abbe/calib/mfb/bar_calibration.hpp"

namespace abbe::calib::mfb {

/// Direction of bar and gauge. The readings are those of the machine axis along the bar, which is
/// inclined to the bar: a reading changes by the distance along the bar times `component`.
struct AlongBar {
  Eigen::Index axis = 0;   ///< machine axis
  double component = 1.0;  ///< of the unit vector along the bar; negative: to smaller readings
  /// Distance along the bar from reading 0.
  [[nodiscard]] double of(const Vector3& v) const { return of(v(axis)); }
  [[nodiscard]] double of(double reading_m) const { return reading_m / component; }
  [[nodiscard]] double reading_m(double distance_m) const { return distance_m * component; }
};

/// E_XX at points along the bar relative to the first point.
struct Positioning {
  Eigen::VectorXd E_m;
  /// of calibration, alignment, temperature and repeatability of the gauge
  Eigen::MatrixXd covariance_m2;
};

/// `along_m`: AlongBar::of() of the points, ascending. BadInput: invalid values of the gauge,
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

#pragma once
/// The line on which a bar lay during its calibration, determined from its touches. The plan gives
/// only approximate places: the bar may be as far from its planned pose as observe() accepts.

#include <string>
#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

/// The machine axis along the bar.
struct AxisAlongBar {
  Eigen::Index axis = 0;
  double sign = 1.0;  ///< -1: the readings decrease along the bar
  /// Coordinate of a reading; it ascends along the bar. For a bar that is inclined to the axis it
  /// is not a length along the bar.
  [[nodiscard]] double of(const Vector3& reading_m) const { return sign * reading_m(axis); }
  [[nodiscard]] double reading_m(double coordinate_m) const { return sign * coordinate_m; }
};

struct BarLine {
  AxisAlongBar along;
  Matrix3 axes =
      Matrix3::Identity();  ///< x: mean direction of all passes; z: about bar_z of the first
  Vector3 middle_m = Vector3::Zero();  ///< centre of the tip in the middle of the bar, machine axes
  double length_m = 0.0;
  double u_direction_rad = 0.0;      ///< standard uncertainty of each of the two angles of x, from
                                     ///< the scatter of the passes
  std::vector<double> coordinate_m;  ///< AxisAlongBar::of() of each hole, mean of the passes
};

/// Computes the line. BadInput: bar_x of a measurement is more than 20 mrad from the machine axis
/// of the first measurement.
[[nodiscard]] Result<BarLine> line_of_bar(const Observations&);

/// Notes about passes in which the bar lay at another place than in the other passes, and about a
/// plan whose bar_x differs by more than `alignment_rad` from the bar.
[[nodiscard]] std::vector<std::string> notes_of_line(const Observations&, const BarLine&,
                                                     double alignment_rad);

/// Text of the angle from `axes`.x to `direction`, such as "3 mrad (y 3, z -0.1 mrad)".
[[nodiscard]] std::string angle_text(const Matrix3& axes, const Vector3& direction);

}  // namespace abbe::calib::mfb

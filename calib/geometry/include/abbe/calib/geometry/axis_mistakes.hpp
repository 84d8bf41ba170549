#pragma once
/// Typical mistakes in a file of coordinates: an axis has the wrong sign, axes are exchanged, or
/// the unit of length is wrong. If the data do not fit as given, the caller applies each of these
/// corrections one after the other. The error message then names the mistakes whose correction
/// makes the data fit. Pure.

#include <span>
#include <string>
#include <vector>

#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

struct AxisMistake {
  std::string text;  ///< "Y reversed", "X and Z swapped"
  Matrix3 M;         ///< correct = M * given; orthogonal
};
/// One or two axes reversed, two axes swapped, or all three axes permuted cyclically.
[[nodiscard]] const std::vector<AxisMistake>& axis_mistakes();

struct UnitMistake {
  std::string text;     ///< "lengths in m instead of mm"
  double factor = 1.0;  ///< correct = factor * given
};
/// Metres, micrometres or inches in a file that must be in millimetres.
[[nodiscard]] const std::vector<UnitMistake>& unit_mistakes();

/// A coordinate outside the travel of its axis.
struct OutsideTravel {
  std::size_t point = 0;
  std::size_t axis = 0;
};
/// All coordinates outside the travel, sorted by point, then by axis. A coordinate up to
/// `tolerance_m` beyond an end counts as inside (default 1 nm: rounding of a file in mm).
[[nodiscard]] std::vector<OutsideTravel> outside_travel(std::span<const Vector3> points_m,
                                                        const MachineNodes& travel,
                                                        double tolerance_m = 1e-9);

/// Names the mistakes whose correction puts all points inside the travel: "; all are inside with Y
/// reversed, or with X and Y swapped". Empty if no correction does, or if no point is farther
/// outside than 5 % of the shortest travel. A unit is named only if the points, in this unit,
/// extend over at least half of the travel of an axis.
[[nodiscard]] std::string corrections_inside_travel(std::span<const Vector3> points_m,
                                                    const MachineNodes& travel);

/// Joins the texts to a list: "A", "A, or with B", "A, or with B, or with C".
[[nodiscard]] std::string or_list(std::span<const std::string> texts);

}  // namespace abbe::calib

#pragma once
/// Mistakes in a list of coordinates that keep its numbers: axes reversed or exchanged, or another
/// unit of length. Where data do not fit as given, each is tried, and the error names those that
/// fit. Pure.

#include <span>
#include <string>
#include <vector>

#include "abbe/calib/axis_table.hpp"
#include "abbe/calib/geometry.hpp"

namespace abbe::calib {

struct AxisMistake {
  std::string text;  ///< "Y reversed", "X and Z swapped"
  Matrix3 M;         ///< right = M given; orthogonal
};
/// One or two axes reversed, two axes swapped, the three in cyclic order.
[[nodiscard]] const std::vector<AxisMistake>& axis_mistakes();

struct UnitMistake {
  std::string text;     ///< "in m where mm belong"
  double factor = 1.0;  ///< right = factor given
};
/// m, um and inches where mm belong.
[[nodiscard]] const std::vector<UnitMistake>& unit_mistakes();

/// A coordinate that its axis cannot have.
struct OutsideTravel {
  std::size_t point = 0;
  std::size_t axis = 0;
};
/// By point, then axis; up to `tolerance_m` beyond the ends counts as inside (1 nm: a file in mm).
[[nodiscard]] std::vector<OutsideTravel> outside_travel(std::span<const Vector3> points_m,
                                                        const MachineNodes& travel,
                                                        double tolerance_m = 1e-9);

/// "; all are inside with Y reversed, or with X and Y swapped". Empty: with none of the mistakes.
[[nodiscard]] std::string inside_travel_with(std::span<const Vector3> points_m,
                                             const MachineNodes& travel);

/// "A", "A, or with B", "A, or with B, or with C"
[[nodiscard]] std::string joined_with_or(std::span<const std::string> texts);

}  // namespace abbe::calib

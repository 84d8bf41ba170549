#pragma once
/// The list of usual mistakes in files of measurements, for every method that reads one: an axis
/// has the wrong sign, axes are exchanged, the unit of length is wrong, angles of a tracker have
/// another meaning. If the data do not fit as given, the caller applies each of these corrections
/// one after the other. The message then names the mistakes whose correction makes the data fit.
/// A mistake is named only if its correction fits far better than the data as given, see
/// far_better(). Other headers treat mistakes with a parameter: a constant of all ranges
/// (internal/geometry, range_change.hpp), and mistakes in directly measured errors (storey
/// `direct`). Pure.

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

struct AxisMistake {
  std::string text;  ///< such as "Y reversed", "X and Z swapped"
  Matrix3 M;         ///< correct = M * given; orthogonal
};
/// One or two axes reversed, two axes swapped, or all three axes permuted cyclically.
[[nodiscard]] const std::vector<AxisMistake>& axis_mistakes();

struct UnitMistake {
  std::string text;     ///< such as "lengths in m instead of mm"
  double factor = 1.0;  ///< correct = factor * given
};
/// Metres, micrometres or inches in a file that must be in millimetres.
[[nodiscard]] const std::vector<UnitMistake>& unit_mistakes();

struct AngleMistake {
  std::string text;  ///< such as "zenith angles instead of elevations"
  /// Computes the correct point from the point that was computed with the wrong angles. In the
  /// frame of the tracker, m.
  Vector3 (*corrected)(const Vector3& p_tracker_m) = nullptr;
};
/// Angles of a tracker with another meaning. A reversed sign of one angle is not in this list: it
/// mirrors the points and is thus among axis_mistakes().
[[nodiscard]] const std::vector<AngleMistake>& angle_mistakes();

/// Largest residual of a correction that fits far better, relative to the residual of the data as
/// given.
inline constexpr double kFarBetter = 1.0 / 3.0;
/// Largest residual of a correction that fits equally well as the best one, relative to the
/// residual of the best one.
inline constexpr double kAsGoodAsBest = 1.5;

struct TriedCorrection {
  std::string text;
  double left = std::numeric_limits<double>::infinity();  ///< residual of the corrected data
};
/// Returns the corrections that fit far better than the data as given and equally well as the best
/// one, best first. `left_as_given`: residual of the data as given, in the unit of `left`. NaN or
/// infinity: does not fit.
[[nodiscard]] std::vector<TriedCorrection> far_better(double left_as_given,
                                                      std::vector<TriedCorrection> tried);

/// A coordinate outside the travel of its axis.
struct OutsideTravel {
  std::size_t point = 0;
  std::size_t axis = 0;
};
/// Finds all coordinates outside the travel, sorted by point, then by axis. A coordinate up to
/// `tolerance_m` beyond an end counts as inside (default 1 nm: rounding of a file in mm).
[[nodiscard]] std::vector<OutsideTravel> outside_travel(std::span<const Vector3> points_m,
                                                        const MachineNodes& travel,
                                                        double tolerance_m = 1e-9);

/// Names the mistakes whose correction puts all points inside the travel: "; all are inside with Y
/// reversed, or with X and Y swapped". Empty if no correction does, or if no point is farther
/// outside than 5 % of the shortest travel. A unit is named only if the points, in this unit,
/// extend over at least half of the travel of an axis. Points in um instead of mm and a travel in m
/// instead of mm have the same correction. The text names the travel if all axes are shorter than
/// 20 mm, else the points.
[[nodiscard]] std::string corrections_inside_travel(std::span<const Vector3> points_m,
                                                    const MachineNodes& travel);

/// Joins the texts to a list: "A", "A, or with B", "A, or with B, or with C".
[[nodiscard]] std::string or_list(std::span<const std::string> texts);

}  // namespace abbe::calib

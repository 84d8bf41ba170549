#pragma once
/// The features of a Multi-Feature Bar [Viprey 2016]: N holes along the bar with axes across it,
/// a rod midway between two holes with its axis across both, and two planes beside each rod. Bar
/// axes: x along the bar from hole 1 to hole N, z along the axes of the holes towards the probing
/// side, y = z x x along the axes of the rods. Lengths in m, in any common Cartesian frame.

#include <array>
#include <string>
#include <vector>

#include "abbe/calib/fit/cylinder.hpp"
#include "abbe/calib/fit/plane.hpp"

namespace abbe::calib::mfb {

/// Planes beside a rod: Left at +y of the bar, Right at -y.
enum class Side { Left, Right };

/// The touched points of one pass along a bar.
struct BarTouches {
  std::vector<std::vector<Vector3>> holes_m;                  ///< N holes
  std::vector<std::vector<Vector3>> rods_m;                   ///< N - 1 rods: rod j after hole j
  std::vector<std::array<std::vector<Vector3>, 2>> planes_m;  ///< N - 1 pairs, by Side

  /// Number of all touches: of the holes, then of the rods, then of the planes. The columns of
  /// derivatives have this order.
  [[nodiscard]] std::size_t count() const;
};

struct BarFeatures {
  std::vector<fit::Cylinder> holes, rods;
  std::vector<std::array<fit::Plane, 2>> planes;  ///< the normals point away from the bar
};

/// Fits all features. `axes`: approximate bar axes as columns, right-handed, orthonormal within
/// 1e-3. BadInput: the numbers of holes, rods and planes do not belong together, there are fewer
/// than 3 holes, a rod is not between its holes, or a plane is not on its side. Other errors are
/// those of the fits; the text begins with the feature ("hole 3", "plane 5 L"), counted from 1.
[[nodiscard]] Result<BarFeatures> fit_features(const BarTouches&, const Matrix3& axes);

/// Names such as "hole 3", "rod 5", "plane 5 L"; `index` counts from 0.
[[nodiscard]] std::string hole_name(std::size_t index);
[[nodiscard]] std::string rod_name(std::size_t index);
[[nodiscard]] std::string plane_name(std::size_t index, Side);

}  // namespace abbe::calib::mfb

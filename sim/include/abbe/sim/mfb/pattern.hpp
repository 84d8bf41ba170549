#pragma once
/// The places at which a tip touches a Multi-Feature Bar [Viprey 2016]: N holes along the bar, a
/// rod between two holes, two planes beside each rod. Bar axes: x from hole 1 to hole N, z along
/// the axes of the holes towards the probing side, y = z x x along the axes of the rods; the origin
/// is at hole 1. Pure.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace abbe::sim::mfb {

struct Pattern {
  /// N elements each; hole_y_m shows in which orientation the bar was clamped
  std::vector<double> hole_x_m, hole_y_m;
  std::vector<double> rod_x_m;  ///< N - 1 elements
  double hole_radius_m = 8e-3;
  std::vector<double> hole_levels_m{-6e-3, 6e-3};  ///< z of the touches in a hole
  std::vector<double> hole_angles_deg{45.0, 135.0, 225.0, 315.0};
  double rod_radius_m = 5e-3;
  std::vector<double> rod_sections_m{-12e-3, -4e-3, 4e-3, 12e-3};  ///< y of the touches on a rod
  std::vector<double> rod_angles_deg{-30.0, 90.0, 210.0};
  double plane_y_m = 18e-3;  ///< the left planes are at +y, the right planes at -y
  std::vector<double> plane_dx_m{-6e-3, 6e-3}, plane_dz_m{-4e-3, 4e-3};

  [[nodiscard]] double length_m() const { return hole_x_m.back(); }
};

/// The bar of the paper for 12 holes and 50 mm: 316 touches. Holes 3 and 5 (for 7 holes: 3 and 4)
/// are shifted by 1 mm in y, which shows in which orientation the bar was clamped. At least 6 holes
/// are needed.
[[nodiscard]] Pattern reference_pattern(std::size_t holes = 12, double pitch_m = 0.05);

enum class Kind : std::uint8_t { Hole, Rod, Plane };
enum class Side : std::uint8_t { Left, Right };  ///< side of a plane: Left +y, Right -y

struct Feature {
  Kind kind = Kind::Hole;
  std::size_t index = 0;  ///< counted from 0
  Side side = Side::Left;
  bool operator==(const Feature&) const = default;
};

/// One touch. The tip approaches along the line through `place_m` with direction -normal.
struct Target {
  Feature feature;
  std::size_t k = 0;  ///< number of the touch within the feature, counted from 0
  Eigen::Vector3d place_m = Eigen::Vector3d::Zero();  ///< point on the nominal surface
  /// normal of the nominal surface, towards the tip
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

/// The side from which the tip reaches the bar. For FromBelow, z of every target is mirrored.
enum class Probed : std::uint8_t { FromAbove, FromBelow };

/// All targets in the order of a forward pass: hole 1, rod 1, planes 1 L and R, hole 2, ...
[[nodiscard]] std::vector<Target> targets(const Pattern& pattern, Probed = Probed::FromAbove);

/// The name of a target as in points.csv: feature, index from 1, side, k. Example: "hole,3,,2".
[[nodiscard]] std::string name(const Target& target);

}  // namespace abbe::sim::mfb

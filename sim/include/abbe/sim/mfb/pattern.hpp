#pragma once
/// Where a tip touches a Multi-Feature Bar [Viprey 2016]: N holes along the bar, a rod between two
/// holes, two planes beside each rod. Bar axes: x from hole 1 to hole N, z along the axes of the
/// holes towards the probing side, y = z x x along the axes of the rods; origin at hole 1. Pure.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace abbe::sim::mfb {

struct Pattern {
  std::vector<double> hole_x_m, hole_y_m;  ///< N; y: the signature, which shows how the bar lies
  std::vector<double> rod_x_m;             ///< N - 1
  double hole_radius_m = 8e-3;
  std::vector<double> hole_levels_m{-6e-3, 6e-3};  ///< z
  std::vector<double> hole_angles_deg{45.0, 135.0, 225.0, 315.0};
  double rod_radius_m = 5e-3;
  std::vector<double> rod_sections_m{-12e-3, -4e-3, 4e-3, 12e-3};  ///< y
  std::vector<double> rod_angles_deg{-30.0, 90.0, 210.0};
  double plane_y_m = 18e-3;  ///< planes L at +y, R at -y
  std::vector<double> plane_dx_m{-6e-3, 6e-3}, plane_dz_m{-4e-3, 4e-3};

  [[nodiscard]] double length_m() const { return hole_x_m.back(); }
};

/// The bar of the paper for 12 holes and 50 mm: 316 touches. Holes 3 and 5 are shifted by 1 mm in
/// y, which shows how the bar lies; of 7 holes they are 3 and 4. Needs 6 holes at least.
[[nodiscard]] Pattern reference_pattern(std::size_t holes = 12, double pitch_m = 0.05);

enum class Kind : std::uint8_t { Hole, Rod, Plane };
enum class Side : std::uint8_t { Left, Right };  ///< of a plane: +y, -y

struct Feature {
  Kind kind = Kind::Hole;
  std::size_t index = 0;  ///< from 0
  Side side = Side::Left;
  bool operator==(const Feature&) const = default;
};

/// One touch. The tip approaches along the line through `place_m` with direction -normal.
struct Target {
  Feature feature;
  std::size_t k = 0;                                  ///< number within the feature, from 0
  Eigen::Vector3d place_m = Eigen::Vector3d::Zero();  ///< on the nominal surface
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< of the nominal surface, to the tip
};

/// Probed: the side from which the tip reaches the bar. From below z of every target is mirrored.
enum class Probed : std::uint8_t { FromAbove, FromBelow };

/// All targets in the order of a forward pass: hole 1, rod 1, planes 1 L and R, hole 2, ...
[[nodiscard]] std::vector<Target> targets(const Pattern& pattern, Probed = Probed::FromAbove);

/// "hole,3,,2": feature, index from 1, side, k, as in points.csv.
[[nodiscard]] std::string name(const Target& target);

}  // namespace abbe::sim::mfb

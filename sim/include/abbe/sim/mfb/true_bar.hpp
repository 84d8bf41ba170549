#pragma once
/// A true Multi-Feature Bar at 20 C without load: every axis and plane has its own place and
/// direction, and every touched place has a form error. In the bar frame R_MFB of its points of
/// interest, m. Pure.

#include <array>
#include <cstdint>
#include <optional>

#include "abbe/sim/mfb/pattern.hpp"

namespace abbe::sim::mfb {

struct TrueCylinder {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  double radius_m = 0.0;
};
struct TruePlane {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< points away from the bar
};

struct TrueBar {
  Pattern pattern;
  std::vector<TrueCylinder> holes, rods;
  std::vector<std::array<TruePlane, 2>> planes;  ///< planes by Side
  /// Form error of the surface at each target, in the order of targets(): positive towards the tip,
  /// m. It contains no part that a least-squares fit of a feature's touches would see as a
  /// displacement of its axis or plane; such a part belongs to the place of the axis or plane.
  std::vector<double> form_m;
};

/// Standard deviations of the deviations that are drawn for one bar.
struct BarDeviations {
  double position_m = 5e-6;  ///< position of an axis or a plane, per coordinate
  double bow_m = 10e-6;      ///< bow of the whole bar in y and z, in the middle
  double pitch_m = 3e-6;     ///< distance of neighbouring holes
  double tilt_rad = 100e-6;  ///< directions of axes and planes
  double radius_m = 3e-6;    ///< radii of holes and rods
  double form_m = 0.3e-6;    ///< form error of the surface at a target
  std::uint64_t seed = 1;
};

[[nodiscard]] TrueBar random_bar(const Pattern& pattern, const BarDeviations& deviations);

/// O_i, one for each hole, in R_MFB: the axis of the hole meets the least-squares plane of the four
/// points where the axes of the rods beside it meet their planes. For the end holes, the plane is
/// the reference plane through the points of the first and of the last rod. O_1 = 0; y and z of O_N
/// are 0.
[[nodiscard]] std::vector<Eigen::Vector3d> points_of_interest_m(const TrueBar& bar);

/// Centre of a tip that touches the bar on the line of `target`, and the touched point of the
/// surface. `number`: number of the form error.
struct Contact {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d surface_m = Eigen::Vector3d::Zero();
};
[[nodiscard]] Contact contact(const TrueBar& bar, const Target& target, std::size_t number,
                              double tip_radius_m);

/// A uniform beam on two supports [bar.toml, table sag]. The sag is the distance of the bar below
/// the line of its supports, along gravity, when gravity is across the bar.
struct Sag {
  std::array<double, 2> beam_x_m{};      ///< ends of the beam
  std::array<double, 2> supports_m{};    ///< x of the supports
  std::array<double, 2> section_yz_m{};  ///< size of the cross-section in the directions y and z
  double density_kg_per_m3 = 8100.0;
  double youngs_modulus_Pa = 145e9;
};
/// The beam of the paper, scaled to the length of the pattern, with the supports that give the
/// least sag.
[[nodiscard]] Sag reference_sag(const Pattern& pattern);
/// Sag at x, m. `height_m`: size of the cross-section in the direction of bending.
[[nodiscard]] double sag_m(const Sag& sag, double height_m, double x_m);

}  // namespace abbe::sim::mfb

#pragma once
/// Data of a Multi-Feature Bar: places at which its features are touched, calibrated places of its
/// points of interest O_i, and dependence of its shape on temperature and gravity. Bar axes as in
/// features.hpp, origin O_1. Lengths in m, angles in rad, temperatures in K. All values hold at 20
/// degC.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/environment/thermal_expansion.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"
#include "abbe/calib/mfb/run/features.hpp"

namespace abbe::calib::mfb {

enum class Feature { Hole, Rod, Plane };

/// Identifies one touch of a bar. Indices count from 0; files and messages count features from 1
/// and k from 0, as points.csv does.
struct Target {
  Feature feature = Feature::Hole;
  std::size_t index = 0;   ///< index of the hole or rod; for a plane: of the rod beside it
  Side side = Side::Left;  ///< side of a plane; Left for holes and rods
  std::size_t k = 0;       ///< number of the touch in its feature
  friend bool operator==(const Target&, const Target&) = default;
};
/// Text such as "hole 3", "rod 5", "plane 5 L".
[[nodiscard]] std::string feature_name(const Target&);
/// Text such as "hole 3, k = 5".
[[nodiscard]] std::string name(const Target&);

/// Nominal places of the touched surfaces, with N holes and N - 1 rods:
/// - hole, level l, angle a: (x + r cos a, y + r sin a, l),  k = level * angles + angle
/// - rod, section s, angle a: (x + r cos a, s, r sin a),     k = section * angles + angle
/// - planes L, R of a rod: (x + dx, +-plane_y, dz),          k = dx * number of dz + dz
struct TouchPattern {
  std::vector<double> hole_x_m;
  std::vector<double> hole_y_m;  ///< signature (orientation.hpp), one per hole
  std::vector<double> rod_x_m;   ///< rod j is between hole j and hole j + 1
  double hole_radius_m = 0.0;
  std::vector<double> hole_levels_m, hole_angles_rad;
  double rod_radius_m = 0.0;
  std::vector<double> rod_sections_m, rod_angles_rad;
  double plane_y_m = 0.0;
  std::vector<double> plane_dx_m, plane_dz_m;

  [[nodiscard]] std::size_t holes() const { return hole_x_m.size(); }
  /// Number of touches of one feature.
  [[nodiscard]] std::size_t touches_of(Feature) const;
  /// Number of all touches of a pass.
  [[nodiscard]] std::size_t count() const;
  /// Index of a touch in the fixed order: holes, rods, then planes (L before R of each rod), k
  /// ascending; this is the order of BarTouches::count(). nullopt: the pattern has no such touch.
  [[nodiscard]] std::optional<std::size_t> place_of(const Target&) const;
  /// True if a hole has a nominal shift in y, by which a turned bar is recognised.
  [[nodiscard]] bool has_signature() const;
};

struct NominalTouch {
  Target target;
  Vector3 tip_m;    ///< centre of the tip, bar axes
  Vector3 outward;  ///< normal of the surface as in PointsOfInterest::normals, bar axes
};
/// All touches in the fixed order. The centre of the tip is inside holes and outside rods and
/// planes, at the distance of the tip radius from the surface. With radius 0: the touched places of
/// the surface.
[[nodiscard]] std::vector<NominalTouch> nominal_touches(const TouchPattern&, double tip_radius_m);

/// Indices of the touches (in the fixed order), sorted in the order of a forward pass: feature by
/// feature along the bar, a rod and its planes after the hole before them.
[[nodiscard]] std::vector<std::size_t> probing_order(const std::vector<NominalTouch>&);

/// Data for the sag of the bar, a uniform beam on two supports. Deflection w below the line of the
/// supports:
///     EI w(x) / q = (x-x0)^4/24 - R_a p(x-a)^3/6 - R_b p(x-b)^3/6 + c1 x + c2,   w(a) = w(b) = 0
///     p(v) = max(v, 0),  R_b = L ((x0+x1)/2 - a)/(b - a),   R_a = L - R_b,   L = x1 - x0
///     q/EI = 12 density g / (E h^2),   g = 9.81 m/s^2,   h: size of the section along the bending
struct Sag {
  std::array<double, 2> beam_x_m{};      ///< ends x0 < x1 of the beam
  std::array<double, 2> supports_m{};    ///< positions a < b of the supports along x
  std::array<double, 2> section_yz_m{};  ///< size of the section along y and z
  double density_kg_per_m3 = 0.0;
  double youngs_modulus_Pa = 0.0;
};
/// Displacement (0, w_y g_y, w_z g_z) of a place at `x_m` along the bar, g: direction of gravity in
/// bar axes, a unit vector.
[[nodiscard]] Vector3 sag_m(const Sag&, double x_m, const Vector3& gravity);

struct Bar {
  std::string name;
  TouchPattern pattern;
  /// Calibrated points of interest as points_of_interest() defines O_bar_m, weightless.
  std::vector<Vector3> O_m;
  /// Covariance of x1 y1 z1 x2 ... in m^2, 3N x 3N; may be singular. Rows of the coordinates that
  /// are 0 by definition (O_1, y and z of O_N) are 0.
  Eigen::MatrixXd covariance_m2;
  std::optional<Expansivity> expansion;  ///< absent: lengths are taken as at 20 C
  std::optional<Sag> sag;                ///< absent: the bar has no sag
};

/// Checks a bar. BadInput: fewer than 3 holes, a pattern whose numbers do not belong together or do
/// not ascend, a size that is not positive, a point of interest more than 1 mm beside the pattern,
/// O_1 or y, z of O_N not 0, or a covariance that is not symmetric or has an eigenvalue below -1e-9
/// of the largest. NotFinite for NaN.
[[nodiscard]] Result<void> check(const Bar&);

/// The points of interest at a temperature: O_i (1 + alpha (T - 20 degC)).
[[nodiscard]] std::vector<Vector3> O_at(const Bar&, double temperature_K);

}  // namespace abbe::calib::mfb

#pragma once
/// A Multi-Feature Bar as it is clamped for one pass: its place, and its deformation by
/// temperature, gravity and clamping. Machine axes unless stated otherwise, m. Pure; deterministic
/// from the seed.

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

#include "abbe/sim/mfb/probing_options.hpp"

namespace abbe::sim::mfb {

/// A point p of the true bar is at T_machine_planned T_planned_bar (growth p + displacement(p.x)),
/// where growth is the factor of the thermal expansion.
struct ClampedBar {
  TrueBar bar;
  std::vector<Target> all;  ///< all targets of the pass, in the order of targets()
  Eigen::Isometry3d T_machine_planned = Eigen::Isometry3d::Identity();
  /// Not the identity if the bar was clamped turned.
  Eigen::Isometry3d T_planned_bar = Eigen::Isometry3d::Identity();
  std::optional<Turned> turned;
  double stated_C = 20.0;
  double growth = 1.0;
  std::optional<Sag> sag;
  Eigen::Vector3d gravity = -Eigen::Vector3d::UnitZ();  ///< direction of gravity
  std::vector<Eigen::Vector3d> shape_m;  ///< displacement of each hole by the clamping, bar axes

  /// Displacement by gravity and clamping, in bar axes, m.
  [[nodiscard]] Eigen::Vector3d displacement_m(double x_m) const;
};

/// The bar during measurement `m` of the plan. Measurements of one position have one pose.
[[nodiscard]] ClampedBar clamped(const TrueBar& bar, std::span<const Measurement> plan,
                                 std::size_t m, const ProbingOptions& options);

/// Distance between a tip with its centre at `tip_m` and the nearest surface of a feature.
/// Assumption: the surfaces of holes, rods and planes end somewhat beyond their outermost touches.
[[nodiscard]] double clearance_m(const ClampedBar& clamped, const Eigen::Vector3d& tip_m,
                                 double tip_radius_m);

}  // namespace abbe::sim::mfb

#pragma once
/// A gauge picks one of the many parameter sets that describe the same machine. Measurements of one
/// target leave 20 combinations of the 14 tables, 3 squareness and 6 rigid unknowns undetermined
/// (24 for all 18 tables and three or more targets), and every choice predicts the same up to a
/// rigid motion. Gauge G1 ([Sanders 2023] sections 2.3.1 and 2.3.2), K U = 0 with exactly as many
/// rows as there are free combinations:
/// - positioning EXX, EYY, EZZ: 0 at the reference position of the axis,
/// - straightness: 0 at the first and at the last node,
/// - rotations: 0 at the reference position;
/// squareness and the rigid unknowns stay free.
/// A model from a ball array ([Li OMM]) states V relative to Ball1: V = 0 there. Its rotation about Ball1 is
/// that of the blocks of the artefact as the machine measured them (Ball1Blocks), or known from elsewhere
/// (Ball1). Neither has conditions on tables.

#include <Eigen/Core>
#include <span>
#include <string_view>

#include "abbe/calib/geometry.hpp"
#include "abbe/calib/parameter_layout.hpp"

namespace abbe::calib {

enum class Gauge { G1, Ball1Blocks, Ball1 };
[[nodiscard]] constexpr std::string_view name(Gauge gauge) {
  switch (gauge) {
    case Gauge::G1:
      break;
    case Gauge::Ball1Blocks:
      return "Ball1-blocks";
    case Gauge::Ball1:
      return "Ball1";
  }
  return "G1";
}

/// For G1. K: one row per condition, fit_size() columns (the six rigid ones last, zero in G1).
[[nodiscard]] Eigen::MatrixXd gauge_conditions(Gauge, const ParameterLayout&);

/// Basis of the combinations (columns, fit_size() rows) that no measurement of `targets_m` anywhere
/// in the volume can see: the null space of complete 3D data on all node positions. The offset of
/// every target but the first is known up to a constant only.
[[nodiscard]] Eigen::MatrixXd unobservable_combinations(const ParameterLayout&,
                                                        std::span<const Vector3> targets_m);

/// U + N z with K (U + N z) = 0. Both vectors have fit_size() entries. The result predicts for the
/// tools of `targets_m` what U does, up to a rigid motion and, for each, a constant.
/// DegenerateGeometry where the targets leave more undetermined than the gauge has conditions: 18
/// tables need three that are not on a line, and then the same holds for every tool.
[[nodiscard]] Result<Eigen::VectorXd> to_gauge(Gauge, const ParameterLayout&,
                                               std::span<const Vector3> targets_m,
                                               const Eigen::VectorXd& U);

}  // namespace abbe::calib

#pragma once
/// A datum selects one of the many parameter sets that describe the same machine.
/// Measurements of one target leave a datum defect of 20: 20 combinations of the 14 tables,
/// 3 squareness and 6 rigid unknowns are not determined (24 for all 18 tables and three or more
/// targets). All these parameter sets predict the same V up to a rigid motion.
///
/// Datum G1 ([Sanders 2023] sections 2.3.1 and 2.3.2) has conditions K U = 0, exactly as many as
/// there are undetermined combinations:
/// - positioning EXX, EYY, EZZ: 0 at the reference position of the axis,
/// - straightness: 0 at the first and at the last node,
/// - rotations: 0 at the reference position.
/// Squareness and the rigid unknowns have no condition. Squareness errors act on the distance from
/// machine zero.
///
/// Datum G2 has the same conditions and the same parameters, but squareness errors act on the
/// distance from the reference position: V at the reference position is then that of the
/// straightness alone, wherever machine zero is. V in G1 and in G2 differ by a constant vector,
///     V_G1 - V_G2 = (-EC0Y y + EB0Z z, -EA0Z z, 0) at the reference position (x, y, z).
/// Every identification gives G2; models of earlier versions of abbe are in G1.
///
/// A model from a ball array ([Li OMM]) has V = 0 at the centre of ball 1 (Ball1). The rotation of
/// V about Ball1 is either that of the blocks of the artefact as the machine measured them (datum
/// Ball1Blocks), or was measured by another instrument (datum Ball1). Neither datum has conditions
/// on tables.

#include <Eigen/Core>
#include <span>
#include <string_view>

#include "abbe/calib/geometry/parameter_layout.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"
#include "abbe/calib/geometry/table_basis.hpp"

namespace abbe::calib {

enum class ModelDatum { G1, G2, Ball1Blocks, Ball1 };
[[nodiscard]] constexpr std::string_view name(ModelDatum datum) {
  switch (datum) {
    case ModelDatum::G1:
      break;
    case ModelDatum::G2:
      return "G2";
    case ModelDatum::Ball1Blocks:
      return "Ball1-blocks";
    case ModelDatum::Ball1:
      return "Ball1";
  }
  return "G1";
}

/// True for the datums of models with tables (G1 and G2).
[[nodiscard]] constexpr bool is_of_tables(ModelDatum datum) {
  return datum == ModelDatum::G1 || datum == ModelDatum::G2;
}

/// Matrix K of datums G1 and G2 for tables: one row per condition, `unknowns` columns. The columns
/// after those of the nodes (squareness, differences between directions of travel, nuisances) are
/// zero.
[[nodiscard]] Eigen::MatrixXd datum_conditions(ModelDatum, const TableBasis&, std::size_t unknowns);
/// Matrix K of datums G1 and G2 for linear tables: one row per condition, fit_size() columns. The
/// last six columns belong to the rigid unknowns and are zero.
[[nodiscard]] Eigen::MatrixXd datum_conditions(ModelDatum, const ParameterLayout&);

/// Basis of the parameter combinations (columns, fit_size() rows) that measurements with the target
/// offsets `targets_m` cannot determine, wherever the measured positions are in the volume. It is
/// the null space of the design matrix with all three components of V at all node positions. In
/// this matrix the offset of each target except the first has an unknown constant.
[[nodiscard]] Eigen::MatrixXd unobservable_combinations(const ParameterLayout&,
                                                        std::span<const Vector3> targets_m);

/// Transforms U into the datum with the conditions K: U + N z, N from unobservable_combinations(),
/// z such that K (U + N z) = 0. Both vectors have fit_size() entries. For the tools of `targets_m`
/// the result predicts the same V as U up to a rigid motion and a constant per tool.
/// DegenerateGeometry if the targets leave more combinations undetermined than the datum has
/// conditions. All 18 tables need three targets that are not on a line; then the result predicts
/// the same as U for every tool.
[[nodiscard]] Result<Eigen::VectorXd> to_datum(ModelDatum, const ParameterLayout&,
                                               std::span<const Vector3> targets_m,
                                               const Eigen::VectorXd& U);

}  // namespace abbe::calib

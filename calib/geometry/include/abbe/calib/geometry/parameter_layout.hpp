#pragma once
/// Order of the entries of the parameter vector U:
/// 1. the tables in use, in the order EXX EYX EZX EAX EBX ECX, EXY .. ECY, EXZ .. ECZ; nodes
///    ascending within a table,
/// 2. the squareness errors EA0Z EB0Z EC0Y,
/// 3. in fits only: the six rigid unknowns tx ty tz [m] rx ry rz [rad] of the tracker station.

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/calib/geometry/kinematic_chain.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

struct Table {
  ErrorMotion motion;
  std::size_t offset = 0;  ///< index in U of the table's first node
};

/// Tables, nodes and squareness of a model, and the index of each parameter in U. Immutable.
class ParameterLayout {
 public:
  /// The 14 tables that are estimable with one constant target offset. The rotations of the axis
  /// nearest to the tool are left out, and so is the rotation of the middle axis about the
  /// direction of the axis nearest to the tool: with a constant lever their effect is a translation
  /// ([Sanders 2023] section 4 counts "14 additional unknowns"). For the order X, Y, Z the tables
  /// ECY EAZ EBZ ECZ are left out.
  [[nodiscard]] static Result<ParameterLayout> observable_with_one_target(const KinematicChain&,
                                                                          MachineNodes);
  /// All 18 tables; estimable only with three or more non-collinear target offsets.
  [[nodiscard]] static Result<ParameterLayout> all_tables(const KinematicChain&, MachineNodes);
  /// Any subset of the 18 tables, sorted into the order EXX .. ECZ of this header. BadInput if a
  /// table is repeated.
  [[nodiscard]] static Result<ParameterLayout> with_tables(const KinematicChain&, MachineNodes,
                                                           std::span<const ErrorMotion>);

  /// Returns the same layout, but with squareness errors that act on the distance from this axis
  /// position.
  [[nodiscard]] ParameterLayout with_squareness_from(const Vector3& axis_position_m) const;

  [[nodiscard]] const KinematicChain& chain() const { return chain_; }
  [[nodiscard]] const MachineNodes& nodes() const { return nodes_; }
  [[nodiscard]] std::span<const Table> tables() const { return tables_; }
  [[nodiscard]] std::optional<Table> find(ErrorMotion) const;
  [[nodiscard]] std::size_t node_count(Axis a) const { return nodes_[index(a)].nodes_m.size(); }

  [[nodiscard]] std::size_t squareness_offset() const { return squareness_offset_; }
  /// Axis position from which squareness errors act; the reference position unless set otherwise.
  [[nodiscard]] const Vector3& squareness_from_m() const { return squareness_from_m_; }
  /// Number of parameters without the rigid unknowns.
  [[nodiscard]] std::size_t model_size() const { return squareness_offset_ + 3; }
  [[nodiscard]] std::size_t rigid_offset() const { return model_size(); }
  /// Number of parameters with the rigid unknowns.
  [[nodiscard]] std::size_t fit_size() const { return model_size() + 6; }

  /// Name of a parameter for messages: "EXX at -0.300 m", "EC0Y", "rx".
  [[nodiscard]] std::string label(std::size_t parameter) const;

 private:
  ParameterLayout() = default;
  KinematicChain chain_;
  MachineNodes nodes_;
  std::vector<Table> tables_;
  std::size_t squareness_offset_ = 0;
  Vector3 squareness_from_m_ = Vector3::Zero();
};

}  // namespace abbe::calib

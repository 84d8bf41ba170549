#pragma once
/// Which number of the parameter vector U is what: the tables in the order EXX EYX EZX EAX EBX ECX
/// | EXY .. ECY | EXZ .. ECZ (those in use), nodes ascending; EA0Z EB0Z EC0Y; then, in fits only,
/// the six rigid unknowns tx ty tz [m] rx ry rz [rad] of the tracker's place.

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/axis_table.hpp"
#include "abbe/calib/kinematic_chain.hpp"

namespace abbe::calib {

struct Table {
  ErrorMotion motion;
  std::size_t offset = 0;  ///< of its first node in U
};

/// Immutable value.
class ParameterLayout {
 public:
  /// The 14 tables that one constant target offset can show: without the rotations of the axis
  /// nearest to the tool and without the rotation of the middle axis about that axis' direction,
  /// which a constant lever makes inseparable from translations ([Sanders 2023] section 4 counts
  /// "14 additional unknowns"). For the order X, Y, Z: no ECY EAZ EBZ ECZ.
  [[nodiscard]] static Result<ParameterLayout> observable_with_one_target(const KinematicChain&,
                                                                          MachineNodes);
  /// All 18 tables; identifiable only from three or more non-collinear target offsets.
  [[nodiscard]] static Result<ParameterLayout> all_tables(const KinematicChain&, MachineNodes);
  /// Any subset, in the canonical order; a repeated table is BadInput.
  [[nodiscard]] static Result<ParameterLayout> with_tables(const KinematicChain&, MachineNodes,
                                                           std::span<const ErrorMotion>);

  [[nodiscard]] const KinematicChain& chain() const { return chain_; }
  [[nodiscard]] const MachineNodes& nodes() const { return nodes_; }
  [[nodiscard]] std::span<const Table> tables() const { return tables_; }
  [[nodiscard]] std::optional<Table> find(ErrorMotion) const;
  [[nodiscard]] std::size_t node_count(Axis a) const { return nodes_[index(a)].nodes_m.size(); }

  [[nodiscard]] std::size_t squareness_offset() const { return squareness_offset_; }
  [[nodiscard]] std::size_t model_size() const {
    return squareness_offset_ + 3;
  }  ///< without rigid
  [[nodiscard]] std::size_t rigid_offset() const { return model_size(); }
  [[nodiscard]] std::size_t fit_size() const { return model_size() + 6; }  ///< with rigid

  /// "EXX at -0.300 m", "EC0Y", "rx".
  [[nodiscard]] std::string label(std::size_t parameter) const;

 private:
  ParameterLayout() = default;
  KinematicChain chain_;
  MachineNodes nodes_;
  std::vector<Table> tables_;
  std::size_t squareness_offset_ = 0;
};

}  // namespace abbe::calib

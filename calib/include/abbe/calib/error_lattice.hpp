#pragma once
/// V known at the nodes of a lattice, as a subscriber receives it, and what such a field is worth
/// against known errors. SI inside (m).

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/model_comparison.hpp"

namespace abbe::calib {

struct LatticeNode {
  Vector3 position_m;
  Vector3 V_m;
  bool inside = true;  ///< within the volume the data covered
};

/// V between the nodes, linear in x, y and z; only in cells of which every corner is inside.
/// Immutable value.
class ErrorLattice {
 public:
  /// Nodes in any order. DegenerateGeometry if they are not all combinations of the coordinates
  /// that occur, each once; NotFinite.
  [[nodiscard]] static Result<ErrorLattice> create(std::span<const LatticeNode> nodes);
  /// False: outside of the lattice or of what the data covered, `V_m` untouched.
  [[nodiscard]] bool at(const Vector3& position_m, Vector3& V_m) const;

 private:
  std::array<std::vector<double>, 3> coordinates_m_;
  std::vector<Vector3> V_m_;  ///< x slowest
  std::vector<bool> inside_;  ///< in the same order
};

struct FieldComparison {
  std::size_t points = 0;   ///< compared
  std::size_t outside = 0;  ///< known errors where the field has no answer
  VectorStatistics before;
  VectorStatistics after;             ///< |V_known - V_field|, gauge as it is
  VectorStatistics after_rigid_free;  ///< the rigid motion no measurement can see taken out
};
/// `known_V_m` at `positions_m`. Error as rigid_free(): fewer than 3 points inside, or on a line.
[[nodiscard]] Result<FieldComparison> compare(std::span<const Vector3> positions_m,
                                              std::span<const Vector3> known_V_m,
                                              const ErrorLattice& field);

}  // namespace abbe::calib

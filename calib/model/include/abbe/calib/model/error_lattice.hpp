#pragma once
/// The volumetric error V at the nodes of a lattice, as a DDS subscriber receives it, and the
/// comparison of such a field with known errors. Lengths in m.

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/model/model_comparison.hpp"

namespace abbe::calib {

struct LatticeNode {
  Vector3 position_m;
  Vector3 V_m;
  bool inside = true;  ///< in the validity volume of the model
};

/// Interpolates V between the nodes, linearly in x, y and z. A cell has a value only if all its
/// corners are `inside`. Immutable value.
class ErrorLattice {
 public:
  /// Nodes in any order. DegenerateGeometry unless every combination of the x, y and z coordinates
  /// that occur is present exactly once. NotFinite for NaN or infinity.
  [[nodiscard]] static Result<ErrorLattice> create(std::span<const LatticeNode> nodes);
  /// False, and `V_m` unchanged, if the position is outside the lattice or in a cell without value.
  [[nodiscard]] bool at(const Vector3& position_m, Vector3& V_m) const;

 private:
  std::array<std::vector<double>, 3> coordinates_m_;
  std::vector<Vector3> V_m_;  ///< by x, then y, then z; z varies fastest
  std::vector<bool> inside_;  ///< same order as V_m_
};

struct FieldComparison {
  std::size_t points = 0;             ///< number of compared points
  std::size_t outside = 0;            ///< points without a value in the field
  VectorStatistics before;            ///< |V_known|
  VectorStatistics after;             ///< |V_known - V_field|, gauges unchanged
  VectorStatistics after_rigid_free;  ///< after removal of the best-fit rigid motion
};
/// Compares `known_V_m` at `positions_m` with the field. Errors as rigid_free(): fewer than 3
/// points inside the field, or all of them on a line.
[[nodiscard]] Result<FieldComparison> compare(std::span<const Vector3> positions_m,
                                              std::span<const Vector3> known_V_m,
                                              const ErrorLattice& field);

}  // namespace abbe::calib

#pragma once
/// The volumetric error V at the nodes of a lattice, as a DDS subscriber receives it. Lengths in m.
/// Pure.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

struct LatticeNode {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d V_m = Eigen::Vector3d::Zero();
  bool inside = true;  ///< true: the node is in the validity volume of the model
};

/// Interpolates V between the nodes, linearly in x, y and z. A cell has a value only if all its
/// corners are `inside`. Immutable value.
class ErrorLattice {
 public:
  /// Nodes in any order. BadInput unless every combination of the x, y and z coordinates that occur
  /// is present exactly once, and for NaN or infinity.
  [[nodiscard]] static Result<ErrorLattice> create(std::span<const LatticeNode> nodes);
  /// False, and `V_m` unchanged, if the position is outside the lattice or in a cell without value.
  [[nodiscard]] bool at(const Eigen::Vector3d& position_m, Eigen::Vector3d& V_m) const;

 private:
  std::array<std::vector<double>, 3> coordinates_m_;
  std::vector<Eigen::Vector3d> V_m_;  ///< values sorted by x, then y, then z; z varies fastest
  std::vector<bool> inside_;          ///< elements in the same order as V_m_
};

}  // namespace abbe::daemon

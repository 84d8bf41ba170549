#include "abbe/messages/error_lattice.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace abbe::daemon {
namespace {

/// Finds the index of the cell that contains x, and the position of x in this cell as a fraction 0
/// to 1. False if x is outside all cells.
bool locate(const std::vector<double>& coordinates, double x, std::size_t& cell, double& fraction) {
  if (coordinates.size() < 2 || x < coordinates.front() || x > coordinates.back()) {
    return false;
  }
  const auto above = std::upper_bound(coordinates.begin() + 1, coordinates.end() - 1, x);
  cell = static_cast<std::size_t>(above - coordinates.begin()) - 1;
  fraction = (x - coordinates[cell]) / (coordinates[cell + 1] - coordinates[cell]);
  return true;
}

std::vector<double> coordinates_of(std::span<const LatticeNode> nodes, Eigen::Index axis) {
  std::vector<double> values;
  for (const LatticeNode& node : nodes) {
    values.push_back(node.position_m[axis]);
  }
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

}  // namespace

Result<ErrorLattice> ErrorLattice::create(std::span<const LatticeNode> nodes) {
  for (const LatticeNode& node : nodes) {
    if (!node.position_m.allFinite() || !node.V_m.allFinite()) {
      return fail(ErrorCode::BadInput, "lattice: a node is not a number");
    }
  }

  ErrorLattice lattice;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    lattice.coordinates_m_[axis] = coordinates_of(nodes, static_cast<Eigen::Index>(axis));
  }

  const auto& [x, y, z] = lattice.coordinates_m_;
  if (nodes.empty() || x.size() * y.size() * z.size() != nodes.size()) {
    return fail(ErrorCode::BadInput,
                fmt::format("lattice: {} nodes are not {} x {} x {} combinations", nodes.size(),
                            x.size(), y.size(), z.size()));
  }

  lattice.V_m_.resize(nodes.size());
  lattice.inside_.resize(nodes.size());
  std::vector<bool> seen(nodes.size(), false);

  for (const LatticeNode& node : nodes) {
    std::size_t index = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto& values = lattice.coordinates_m_[axis];
      const auto at = std::lower_bound(values.begin(), values.end(),
                                       node.position_m[static_cast<Eigen::Index>(axis)]);
      index = index * values.size() + static_cast<std::size_t>(at - values.begin());
    }

    if (seen[index]) {
      const Eigen::Vector3d p_mm = 1e3 * node.position_m;
      return fail(ErrorCode::BadInput,
                  fmt::format("lattice: the node at ({:.6g}, {:.6g}, {:.6g}) mm occurs twice",
                              p_mm.x(), p_mm.y(), p_mm.z()));
    }

    seen[index] = true;
    lattice.V_m_[index] = node.V_m;
    lattice.inside_[index] = node.inside;
  }

  return lattice;
}

bool ErrorLattice::at(const Eigen::Vector3d& position_m, Eigen::Vector3d& V_m) const {
  std::array<std::size_t, 3> cell{};
  std::array<double, 3> fraction{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!locate(coordinates_m_[axis], position_m[static_cast<Eigen::Index>(axis)], cell[axis],
                fraction[axis])) {
      return false;
    }
  }

  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t corner = 0; corner < 8; ++corner) {
    double weight = 1.0;
    std::size_t index = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t far = (corner >> axis) & 1u;
      weight *= far == 1 ? fraction[axis] : 1.0 - fraction[axis];
      index = index * coordinates_m_[axis].size() + cell[axis] + far;
    }
    if (!inside_[index]) {
      return false;
    }
    sum += weight * V_m_[index];
  }

  V_m = sum;
  return true;
}

}  // namespace abbe::daemon

#include "abbe/calib/model/error_lattice.hpp"

#include <algorithm>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib {
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
      return failure(ErrorCode::NotFinite, "lattice: a node is not a number");
    }
  }

  ErrorLattice lattice;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    lattice.coordinates_m_[axis] = coordinates_of(nodes, static_cast<Eigen::Index>(axis));
  }

  const auto& [x, y, z] = lattice.coordinates_m_;
  if (nodes.empty() || x.size() * y.size() * z.size() != nodes.size()) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("lattice: ", nodes.size(), " nodes are not ", x.size(), " x ", y.size(),
                           " x ", z.size(), " combinations"));
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
      return failure(ErrorCode::DegenerateGeometry,
                     message("lattice: the node at ", mm_text(node.position_m), " occurs twice"));
    }

    seen[index] = true;
    lattice.V_m_[index] = node.V_m;
    lattice.inside_[index] = node.inside;
  }

  return lattice;
}

bool ErrorLattice::at(const Vector3& position_m, Vector3& V_m) const {
  std::array<std::size_t, 3> cell{};
  std::array<double, 3> fraction{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!locate(coordinates_m_[axis], position_m[static_cast<Eigen::Index>(axis)], cell[axis],
                fraction[axis])) {
      return false;
    }
  }

  Vector3 sum = Vector3::Zero();
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

Result<FieldComparison> compare(std::span<const Vector3> positions_m,
                                std::span<const Vector3> known_V_m, const ErrorLattice& field) {
  FieldComparison comparison;
  std::vector<Vector3> points, before, after;
  for (std::size_t i = 0; i < positions_m.size(); ++i) {
    Vector3 V;
    if (!field.at(positions_m[i], V)) {
      ++comparison.outside;
      continue;
    }
    points.push_back(positions_m[i]);
    before.push_back(known_V_m[i]);
    after.push_back(known_V_m[i] - V);
  }

  comparison.points = points.size();
  const auto difference = rigid_free(points, after);
  if (!difference) {
    return failure(difference.error().code,
                   message("compare: ", points.size(),
                           " points inside the lattice: ", difference.error().text));
  }

  comparison.before = vector_statistics(before);
  comparison.after = difference->as_stated;
  comparison.after_rigid_free = difference->rigid_free;

  return comparison;
}

}  // namespace abbe::calib

#include "abbe/messages/error_lattice.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <optional>

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

FieldComparison::Lengths lengths_of(std::span<const Eigen::Vector3d> vectors_m) {
  FieldComparison::Lengths lengths;
  for (const Eigen::Vector3d& v : vectors_m) {
    lengths.mean_m += v.norm() / static_cast<double>(vectors_m.size());
    lengths.max_m = std::max(lengths.max_m, v.norm());
  }
  return lengths;
}

/// The vectors without their best-fit motion T + r x p. nullopt if the points lie on a line.
std::optional<std::vector<Eigen::Vector3d>> without_motion(
    std::span<const Eigen::Vector3d> points_m, std::span<const Eigen::Vector3d> vectors_m) {
  const auto mean = [](std::span<const Eigen::Vector3d> all) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& v : all) sum += v;
    return Eigen::Vector3d(sum / static_cast<double>(all.size()));
  };
  const Eigen::Vector3d centre = mean(points_m), translation = mean(vectors_m);

  // With points relative to their centroid, translation and rotation are decoupled.
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    const Eigen::Vector3d p = points_m[i] - centre;
    inertia += p.squaredNorm() * Eigen::Matrix3d::Identity() - p * p.transpose();
    moment += p.cross(vectors_m[i]);
  }
  constexpr double kLine = 1e-12;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(inertia, Eigen::EigenvaluesOnly);
  if (!(eigen.eigenvalues()(0) > kLine * eigen.eigenvalues()(2))) return std::nullopt;

  const Eigen::Vector3d rotation = inertia.ldlt().solve(moment);
  std::vector<Eigen::Vector3d> rest_m;
  for (std::size_t i = 0; i < points_m.size(); ++i)
    rest_m.push_back(vectors_m[i] - translation - rotation.cross(points_m[i] - centre));
  return rest_m;
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
    return fail(ErrorCode::BadInput, fmt::format("lattice: {} nodes are not {} x {} x {} combinations",
                                                 nodes.size(), x.size(), y.size(), z.size()));
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
      const Eigen::Eigen::Vector3dd p_mm = 1e3 * node.position_m;
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

Result<FieldComparison> compare(std::span<const Eigen::Vector3d> positions_m,
                                std::span<const Eigen::Vector3d> known_V_m,
                                const ErrorLattice& field) {
  FieldComparison comparison;
  std::vector<Eigen::Vector3d> points_m, before_m, after_m;
  for (std::size_t i = 0; i < positions_m.size(); ++i) {
    Eigen::Vector3d V_m;
    if (!field.at(positions_m[i], V_m)) {
      ++comparison.outside;
      continue;
    }
    points_m.push_back(positions_m[i]);
    before_m.push_back(known_V_m[i]);
    after_m.push_back(known_V_m[i] - V_m);
  }

  comparison.points = points_m.size();
  constexpr std::size_t kLeastPoints = 3;
  const auto rest_m =
      points_m.size() < kLeastPoints ? std::nullopt : without_motion(points_m, after_m);
  if (!rest_m)
    return fail(ErrorCode::DataInsufficient,
                fmt::format("compare: {} points inside the lattice: needs {} that do not lie on a "
                            "line, to remove the rigid motion",
                            points_m.size(), kLeastPoints));

  comparison.before = lengths_of(before_m);
  comparison.after = lengths_of(after_m);
  comparison.after_rigid_free = lengths_of(*rest_m);
  return comparison;
}

}  // namespace abbe::daemon

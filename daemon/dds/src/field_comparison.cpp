#include "abbe/dds/field_comparison.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <optional>
#include <vector>

namespace abbe::dds {
namespace {

FieldComparison::Lengths lengths_of(std::span<const Eigen::Vector3d> vectors_m) {
  FieldComparison::Lengths lengths;
  for (const Eigen::Vector3d& v : vectors_m) {
    lengths.mean_m += v.norm() / static_cast<double>(vectors_m.size());
    lengths.max_m = std::max(lengths.max_m, v.norm());
  }
  return lengths;
}

/// The vectors without their best-fit motion T + r x p, as calib::rigid_free() computes it. nullopt
/// if the points lie on a line.
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

daemon::Result<FieldComparison> compare(std::span<const Eigen::Vector3d> positions_m,
                                        std::span<const Eigen::Vector3d> known_V_m,
                                        const daemon::ErrorLattice& field) {
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
    return daemon::fail(
        daemon::ErrorCode::DataInsufficient,
        fmt::format("compare: {} points inside the lattice: needs {} that do not lie on a "
                    "line, to remove the rigid motion",
                    points_m.size(), kLeastPoints));

  comparison.before = lengths_of(before_m);
  comparison.after = lengths_of(after_m);
  comparison.after_rigid_free = lengths_of(*rest_m);
  return comparison;
}

}  // namespace abbe::dds

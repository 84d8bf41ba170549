#include "lines.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::calib::iso {
namespace {

// Least numbers of targets of [ISO 230-2] for axes up to 2 m; for longer axes it permits fewer per
// metre.
constexpr double kFewestTargets = 5.0, kFewestPerMetre = 5.0;
// Number of targets for models that are curved between their nodes: a chord then differs from a
// polynomial of order 5 by less than 1 % of its range.
constexpr double kTargetsOfCurve = 41.0;

/// The largest factor, at most 1, by which the box with half width `half_m` about `centre_m` can be
/// scaled so that all corners are in the volume.
double largest_factor(const ValidityVolume& volume, const Vector3& centre_m,
                      const Vector3& half_m) {
  const auto holds = [&](double factor) {
    for (int i = 0; i < 8; ++i) {
      const Vector3 sign((i & 1) != 0 ? 1.0 : -1.0, (i & 2) != 0 ? 1.0 : -1.0,
                         (i & 4) != 0 ? 1.0 : -1.0);
      if (!volume.contains(centre_m + factor * sign.cwiseProduct(half_m))) {
        return false;
      }
    }
    return true;
  };
  if (holds(1.0)) {
    return 1.0;
  }

  constexpr int kSteps = 30;  // bisections: 1 nm of 1 m
  double inside = 0.0, outside = 1.0;
  for (int i = 0; i < kSteps; ++i) {
    const double middle = 0.5 * (inside + outside);
    (holds(middle) ? inside : outside) = middle;
  }
  return inside;
}

/// Halves the longest interval repeatedly until there are enough targets.
void complete(std::vector<double>& targets_m, double least) {
  const double length_m = targets_m.back() - targets_m.front();
  const double fewest = std::max(least, std::ceil(kFewestPerMetre * length_m - 1e-9));
  while (static_cast<double>(targets_m.size()) < fewest) {
    std::size_t longest = 1;
    for (std::size_t i = 1; i < targets_m.size(); ++i) {
      if (targets_m[i] - targets_m[i - 1] > targets_m[longest] - targets_m[longest - 1] + 1e-9) {
        longest = i;
      }
    }
    targets_m.insert(targets_m.begin() + static_cast<std::ptrdiff_t>(longest),
                     0.5 * (targets_m[longest - 1] + targets_m[longest]));
  }
}

}  // namespace

Result<LineBox> line_box(const ValidityVolume& volume) {
  if (volume.vertices_m().empty()) {
    return failure(ErrorCode::DegenerateGeometry, "standard values: the model has no valid volume");
  }

  LineBox box{volume.vertices_m().front(), volume.vertices_m().front()};
  Vector3 mean_m = Vector3::Zero();
  for (const Vector3& q : volume.vertices_m()) {
    box.low_m = box.low_m.cwiseMin(q);
    box.high_m = box.high_m.cwiseMax(q);
    mean_m += q / static_cast<double>(volume.vertices_m().size());
  }

  const Vector3 half_m = 0.5 * (box.high_m - box.low_m);
  const Vector3 centre_m = volume.contains(box.centre_m()) ? box.centre_m() : mean_m;
  const double factor = largest_factor(volume, centre_m, half_m);
  if (factor < 1.0 || centre_m != box.centre_m()) {
    box = {centre_m - factor * half_m, centre_m + factor * half_m, false};
  }
  return box;
}

AxisLine line_of(const VolumetricModel& model, const LineBox& box, Axis axis) {
  constexpr double kApart_m = 1e-6;
  const auto a = static_cast<Eigen::Index>(index(axis));
  AxisLine line{axis, box.centre_m(), {box.low_m(a)}};
  for (const double node_m : model.nodes()[index(axis)].nodes_m) {
    if (node_m > box.low_m(a) + kApart_m && node_m < box.high_m(a) - kApart_m) {
      line.targets_m.push_back(node_m);
    }
  }
  line.targets_m.push_back(box.high_m(a));
  complete(line.targets_m, model.linear_between_nodes() ? kFewestTargets : kTargetsOfCurve);
  return line;
}

Eigen::MatrixXd AxisLine::rows(const ErrorFunctions& functions, std::size_t component,
                               Travel travel) const {
  AxisTravel all{};
  all[index(axis)] = travel;
  Eigen::MatrixXd rows;
  for (std::size_t i = 0; i < targets_m.size(); ++i) {
    Vector3 q_m = through_m;
    q_m(static_cast<Eigen::Index>(index(axis))) = targets_m[i];
    const Eigen::RowVectorXd row =
        functions.row(q_m, Vector3::Unit(static_cast<Eigen::Index>(component)), all);
    if (i == 0) {
      rows.resize(static_cast<Eigen::Index>(targets_m.size()), row.size());
    }
    rows.row(static_cast<Eigen::Index>(i)) = row;
  }
  return rows;
}

}  // namespace abbe::calib::iso

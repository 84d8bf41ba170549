#include "plan/plan_place.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib::mfb {
namespace {

constexpr double kHalfDegree_rad = std::numbers::pi / 360.0;

Vector3 in_plane(std::size_t first, std::size_t second, double angle_rad, double sign) {
  const SinCos a = sin_cos(angle_rad);
  Vector3 x = Vector3::Zero();
  x(static_cast<Eigen::Index>(first)) = a.cos;
  x(static_cast<Eigen::Index>(second)) = sign * a.sin;
  return x;
}

/// Component along the ram of a tool offset: that of the stylus along the ram, else that of the
/// first stylus.
Vector3 ram_offset_m(const PlanTask& task) {
  const std::size_t ram = index(task.machine.chain.order_w_to_t()[2]);
  const StyliAlong found = styli_along(task, ram);
  const std::size_t stylus = found.against.value_or(found.along.value_or(0));
  const auto k = static_cast<Eigen::Index>(ram);
  return task.styli[stylus].tool_offset_m(k) * Vector3::Unit(k);
}

}  // namespace

Vector3 middle_of_travel(const PlanTask& task) {
  Vector3 middle_m = ram_offset_m(task);
  for (std::size_t k = 0; k < 3; ++k) {
    const std::vector<double>& nodes_m = task.machine.nodes[k].nodes_m;
    middle_m(static_cast<Eigen::Index>(k)) += 0.5 * (nodes_m.front() + nodes_m.back());
  }
  return middle_m;
}

StyliAlong styli_along(const PlanTask& task, std::size_t axis) {
  constexpr double kAlong = 0.99;  // cosine of 8 degrees
  const auto k = static_cast<Eigen::Index>(axis);
  const auto prefer = [&](std::optional<std::size_t>& best, std::size_t i, double sign) {
    const auto reach = [&](std::size_t s) { return sign * task.styli[s].tool_offset_m(k); };
    if (sign * task.styli[i].stem(k) > kAlong && (!best || reach(i) > reach(*best))) {
      best = i;
    }
  };
  StyliAlong found;
  for (std::size_t i = 0; i < task.styli.size(); ++i) {
    prefer(found.against, i, -1.0);
    prefer(found.along, i, 1.0);
  }
  return found;
}

Matrix3 bar_axes(const Vector3& x, const Vector3& z) {
  Matrix3 axes;
  axes << x, z.cross(x), z;
  return axes;
}

BarPlacer::BarPlacer(const PlanTask& task)
    : task_(&task),
      touches_(nominal_touches(task.bar.pattern, task.settings.tip_radius_m)),
      length_m_(task.bar.pattern.hole_x_m.back()),
      ram_offset_m_(ram_offset_m(task)) {}

double BarPlacer::lo_m(std::size_t axis) const {
  return task_->machine.nodes[axis].nodes_m.front();
}
double BarPlacer::hi_m(std::size_t axis) const {
  return task_->machine.nodes[axis].nodes_m.back();
}

double BarPlacer::overhang_m(std::size_t axis) const {
  const std::vector<double>& nodes_m = task_->machine.nodes[axis].nodes_m;
  const double end_cell_m =
      std::min(nodes_m[1] - nodes_m[0], nodes_m.back() - nodes_m[nodes_m.size() - 2]);
  constexpr double kRoundedPlace_m = 1e-4;  // plan_of() rounds places by up to this
  return std::min(task_->bar.pattern.hole_radius_m, 0.5 * end_cell_m - kRoundedPlace_m);
}

ReadingRange BarPlacer::readings(const Matrix3& axes, std::span<const std::size_t> styli) const {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  ReadingRange range{Vector3::Constant(kInfinite), Vector3::Constant(-kInfinite)};
  for (const NominalTouch& touch : touches_) {
    const Vector3 tip_m = axes * touch.tip_m;
    range.min_m = range.min_m.cwiseMin(tip_m);
    range.max_m = range.max_m.cwiseMax(tip_m);
  }

  Vector3 least_m = Vector3::Constant(kInfinite), most_m = Vector3::Constant(-kInfinite);
  for (const std::size_t s : styli) {
    least_m = least_m.cwiseMin(task_->styli[s].tool_offset_m);
    most_m = most_m.cwiseMax(task_->styli[s].tool_offset_m);
  }
  return {range.min_m - most_m, range.max_m - least_m};
}

BarPlacer::Room BarPlacer::room(const Matrix3& axes, std::span<const std::size_t> styli) const {
  const ReadingRange range = readings(axes, styli);
  Room room;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<Eigen::Index>(axis);
    const double lo = lo_m(axis) - overhang_m(axis), hi = hi_m(axis) + overhang_m(axis);
    const double along_m = length_m_ * axes(k, 0);
    room.min_m(k) = std::max(lo - range.min_m(k), lo + ram_offset_m_(k) - std::min(along_m, 0.0));
    room.max_m(k) = std::min(hi - range.max_m(k), hi + ram_offset_m_(k) - std::max(along_m, 0.0));
  }
  return room;
}

std::optional<Vector3> BarPlacer::nearest(const Matrix3& axes, std::span<const std::size_t> styli,
                                          const Vector3& wanted_m) const {
  const Room places = room(axes, styli);
  if (!places.exists()) {
    return std::nullopt;
  }
  return wanted_m.cwiseMax(places.min_m).cwiseMin(places.max_m);
}

std::optional<BarDirection> BarPlacer::along(std::size_t axis, std::size_t other, double sign,
                                             const Vector3& z,
                                             std::span<const std::size_t> styli) const {
  constexpr int kMostSteps = 140;  // 70 degrees; with more inclination it is a bar along the other
                                   // axis
  for (int step = 0; step <= kMostSteps; ++step) {
    const double angle_rad = kHalfDegree_rad * step;
    const Vector3 x = in_plane(axis, other, angle_rad, sign);
    if (room(bar_axes(x, z), styli).exists()) {
      return BarDirection{x, angle_rad};
    }
  }
  return std::nullopt;
}

std::optional<BarDirection> BarPlacer::diagonal(std::size_t first, std::size_t second, double sign,
                                                const Vector3& z,
                                                std::span<const std::size_t> styli) const {
  constexpr int kMostSteps = 60;  // steps of half a degree: 30 degrees
  for (int step = 0; step <= kMostSteps; ++step) {
    for (const int side : {1, -1}) {
      const double angle_rad = 0.25 * std::numbers::pi + side * step * kHalfDegree_rad;
      const Vector3 x = in_plane(first, second, angle_rad, sign);
      if (room(bar_axes(x, z), styli).exists()) {
        return BarDirection{x, angle_rad};
      }
    }
  }
  return std::nullopt;
}

std::vector<double> BarPlacer::starts_m(std::size_t axis) const {
  const double rest_m = travel_m(axis) - length_m_;
  if (rest_m <= 2.0 * overhang_m(axis)) {
    return {lo_m(axis) + 0.5 * rest_m};
  }
  constexpr double kRounding = 1e-9;
  const double step_m = length_m_ * (1.0 - task_->overlap);
  const auto further = static_cast<std::size_t>(std::ceil(rest_m / step_m - kRounding));
  std::vector<double> starts_m;
  for (std::size_t i = 0; i <= further; ++i) {
    starts_m.push_back(lo_m(axis) + rest_m * static_cast<double>(i) / static_cast<double>(further));
  }
  return starts_m;
}

}  // namespace abbe::calib::mfb

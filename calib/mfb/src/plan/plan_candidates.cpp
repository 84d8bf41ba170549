#include <algorithm>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"
#include "plan/plan_place.hpp"

namespace abbe::calib::mfb {
namespace {

using StyliOfPosition = std::vector<std::size_t>;

/// Possible styli of a position: one stylus, or two with opposite stems. The first one is on the
/// probing side of the bar.
std::vector<StyliOfPosition> styli_choices(const PlanTask& task, std::size_t holes) {
  const StyliAlong found = styli_along(task, holes);
  std::vector<StyliOfPosition> choices;
  for (const std::optional<std::size_t>& one : {found.against, found.along}) {
    if (one) {
      choices.push_back({*one});
    }
  }
  if (found.against && found.along) {
    choices.push_back({*found.against, *found.along});
  }
  return choices;
}

/// Both ends and the middle of an interval without its margins; one value if the interval is short.
std::vector<double> places_between(double min_m, double max_m, double margin_m) {
  constexpr double kShort_m = 10e-3;
  min_m += margin_m;
  max_m -= margin_m;
  if (max_m - min_m < kShort_m) {
    return {0.5 * (min_m + max_m)};
  }
  return {min_m, 0.5 * (min_m + max_m), max_m};
}

/// Appends all candidates with holes along one axis.
class CandidateList {
 public:
  explicit CandidateList(const PlanTask& task) : task_(task), placer_(task) {}

  void add(std::size_t holes, const StyliOfPosition& styli) {
    const std::size_t first = (holes + 1) % 3, second = (holes + 2) % 3;
    const Vector3 z = -task_.styli[styli.front()].stem;
    add_along(first, second, z, styli);
    add_along(second, first, z, styli);
    for (const double sign : {1.0, -1.0}) {
      if (const auto direction =
              placer_.diagonal(std::min(first, second), std::max(first, second), sign, z, styli)) {
        const std::string label = message('D', letter(kAllAxes[std::min(first, second)]),
                                          letter(kAllAxes[std::max(first, second)]));
        add_places(label, direction->x, z, styli, holes);
      }
    }
  }
  [[nodiscard]] std::vector<PlannedPosition> take() { return std::move(all_); }

 private:
  void add_along(std::size_t axis, std::size_t other, const Vector3& z,
                 const StyliOfPosition& styli) {
    const std::optional<BarDirection> direction = placer_.along(axis, other, 1.0, z, styli);
    if (!direction) {
      return;
    }
    const std::string label(1, letter(kAllAxes[axis]));
    if (direction->angle_rad > 0.0) {
      const std::size_t holes = 3 - axis - other;
      add_places(label, direction->x, z, styli, holes);
      Vector3 mirrored = direction->x;
      mirrored(static_cast<Eigen::Index>(other)) *= -1.0;
      add_places(label, mirrored, z, styli, holes);
      return;
    }
    for (const double start_m : placer_.starts_m(axis)) {
      add_across(label, axis, start_m, z, styli);
    }
  }

  /// Adds bars along an axis at 3 x 3 places across it.
  void add_across(const std::string& label, std::size_t axis, double start_m, const Vector3& z,
                  const StyliOfPosition& styli) {
    const auto k = static_cast<Eigen::Index>(axis);
    const Vector3 x = Vector3::Unit(k);
    const Matrix3 axes = bar_axes(x, z);
    const BarPlacer::Room room = placer_.room(axes, styli);
    const auto u = (k + 1) % 3, v = (k + 2) % 3;
    Vector3 origin_m;
    origin_m(k) = start_m + task_.styli[styli.front()].tool_offset_m(k);
    for (const double u_m : places_across(room, u)) {
      for (const double v_m : places_across(room, v)) {
        origin_m(u) = u_m;
        origin_m(v) = v_m;
        if (const auto fitting_m = placer_.nearest(axes, styli, origin_m)) {
          all_.push_back({label, {*fitting_m, axes}, styli});
        }
      }
    }
  }

  /// Adds inclined bars in the middle of their plane, at three places along their holes.
  void add_places(const std::string& label, const Vector3& x, const Vector3& z,
                  const StyliOfPosition& styli, std::size_t holes) {
    const Matrix3 axes = bar_axes(x, z);
    const BarPlacer::Room room = placer_.room(axes, styli);
    const auto h = static_cast<Eigen::Index>(holes);
    Vector3 origin_m = 0.5 * (room.min_m + room.max_m);
    for (const double at_m : places_across(room, h)) {
      origin_m(h) = at_m;
      all_.push_back({label, {origin_m, axes}, styli});
    }
  }

  /// Places across the bar at which all touches are within the travel.
  [[nodiscard]] std::vector<double> places_across(const BarPlacer::Room& room,
                                                  Eigen::Index k) const {
    return places_between(room.min_m(k), room.max_m(k),
                          placer_.overhang_m(static_cast<std::size_t>(k)));
  }

  const PlanTask& task_;
  BarPlacer placer_;
  std::vector<PlannedPosition> all_;
};

}  // namespace

Result<std::vector<PlannedPosition>> candidate_positions(const PlanTask& task) {
  ABBE_TRY(check(task));
  CandidateList list(task);
  for (std::size_t holes = 0; holes < 3; ++holes) {
    for (const StyliOfPosition& styli : styli_choices(task, holes)) {
      list.add(holes, styli);
    }
  }
  return list.take();
}

}  // namespace abbe::calib::mfb

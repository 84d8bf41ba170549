// Reads [pattern] of bar.toml: the places at which the features of a Multi-Feature Bar are touched.
#include "bar_pattern.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "abbe/base/units.hpp"
#include "abbe/calib/mfb/run/points_of_interest.hpp"

namespace abbe::daemon {
namespace {

using calib::mfb::TouchPattern;

constexpr Unit kDegrees{180.0 / std::numbers::pi};
// Limits of the numbers. The upper limits are far above any real bar, and far below the memory of a
// computer.
constexpr std::size_t kFewestBarHoles = 3, kMostBarHoles = 100, kMostBarTouches = 20000;

std::vector<double> sorted(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values;
}

/// Reads the coordinates of one direction of a pattern. There must be at least `least`, all
/// different.
void read_coordinates(Section& pattern, std::string_view key, std::vector<double>& out, Unit unit,
                      std::size_t least) {
  if (!pattern.get(key, out, unit, Need::Required)) return;
  const auto ordered = sorted(out);
  if (std::adjacent_find(ordered.begin(), ordered.end()) != ordered.end())
    pattern.fault(key, "a value is repeated");
  else if (out.size() < least)
    pattern.fault(key, fmt::format("{} values, needs at least {}", out.size(), least));
}

bool ascends(const std::vector<double>& values) {
  return std::adjacent_find(values.begin(), values.end(), std::greater_equal<>{}) == values.end();
}

void read_hole_axes(Section& pattern, TouchPattern& out) {
  if (pattern.get("hole_x_mm", out.hole_x_m, kMilli, Need::Required)) {
    if (out.hole_x_m.size() < kFewestBarHoles || out.hole_x_m.size() > kMostBarHoles)
      pattern.fault("hole_x_mm", fmt::format("{} holes, must be {} to {}", out.hole_x_m.size(),
                                             kFewestBarHoles, kMostBarHoles));
    else if (out.hole_x_m.front() != 0.0)
      pattern.fault("hole_x_mm", fmt::format("begins with {}, but hole 1 is the origin: 0",
                                             out.hole_x_m.front() * kMmPerM));
    if (!ascends(out.hole_x_m)) pattern.fault("hole_x_mm", "must ascend");
  }

  out.hole_y_m.assign(out.hole_x_m.size(), 0.0);
  if (!pattern.get("hole_y_mm", out.hole_y_m, kMilli)) return;
  if (out.hole_y_m.size() != out.hole_x_m.size())
    pattern.fault("hole_y_mm",
                  fmt::format("{} values for {} holes", out.hole_y_m.size(), out.hole_x_m.size()));
  else if (!out.hole_y_m.empty() && (out.hole_y_m.front() != 0.0 || out.hole_y_m.back() != 0.0))
    pattern.fault("hole_y_mm", "the first and the last hole define the x axis of the bar: 0");
}

void read_rod_axes(Section& pattern, TouchPattern& out) {
  if (!pattern.get("rod_x_mm", out.rod_x_m, kMilli, Need::Required)) return;
  const auto& holes = out.hole_x_m;
  if (holes.empty()) return;
  if (out.rod_x_m.size() + 1 != holes.size()) {
    pattern.fault("rod_x_mm", fmt::format("{} rods for {} holes, needs one between two holes: {}",
                                          out.rod_x_m.size(), holes.size(), holes.size() - 1));
    return;
  }

  for (std::size_t j = 0; j < out.rod_x_m.size(); ++j)
    if (out.rod_x_m[j] <= holes[j] || out.rod_x_m[j] >= holes[j + 1])
      pattern.fault("rod_x_mm",
                    fmt::format("rod {} at {:g} is not between holes {} and {} at {:g} and {:g}",
                                j + 1, out.rod_x_m[j] * kMmPerM, j + 1, j + 2, holes[j] * kMmPerM,
                                holes[j + 1] * kMmPerM));
}

/// Reads the places of the touches. A cylinder needs points at three angles on two levels, a plane
/// needs a rectangle of points.
void read_touched_places(Section& pattern, TouchPattern& out) {
  pattern.get("hole_radius_mm", out.hole_radius_m, kMilli, kPositive, Need::Required);
  read_coordinates(pattern, "hole_levels_mm", out.hole_levels_m, kMilli, 2);
  read_coordinates(pattern, "hole_angles_deg", out.hole_angles_rad, kDegrees, 3);
  pattern.get("rod_radius_mm", out.rod_radius_m, kMilli, kPositive, Need::Required);
  read_coordinates(pattern, "rod_sections_mm", out.rod_sections_m, kMilli, 2);
  read_coordinates(pattern, "rod_angles_deg", out.rod_angles_rad, kDegrees, 3);
  pattern.get("plane_y_mm", out.plane_y_m, kMilli, kPositive, Need::Required);
  read_coordinates(pattern, "plane_dx_mm", out.plane_dx_m, kMilli, 2);
  read_coordinates(pattern, "plane_dz_mm", out.plane_dz_m, kMilli, 2);
}

/// All touches of the pattern, on the nominal bar.
calib::mfb::BarTouches touches_of(const TouchPattern& pattern) {
  calib::mfb::BarTouches touches;
  touches.holes_m.resize(pattern.hole_x_m.size());
  touches.rods_m.resize(pattern.rod_x_m.size());
  touches.planes_m.resize(pattern.rod_x_m.size());
  for (const auto& [target, tip_m, outward] : calib::mfb::nominal_touches(pattern, 0.0)) {
    switch (target.feature) {
      case calib::mfb::Feature::Hole:
        touches.holes_m[target.index].push_back(tip_m);
        break;
      case calib::mfb::Feature::Rod:
        touches.rods_m[target.index].push_back(tip_m);
        break;
      case calib::mfb::Feature::Plane:
        touches.planes_m[target.index][static_cast<std::size_t>(target.side)].push_back(tip_m);
        break;
    }
  }
  return touches;
}

/// Adds a fault if the nominal touches do not determine all features.
void check_determined(Section& pattern, const TouchPattern& given) {
  if (given.count() > kMostBarTouches) {
    pattern.fault("", fmt::format("{} touches, at most {}", given.count(), kMostBarTouches));
    return;
  }
  const auto fitted = calib::mfb::points_of_interest(touches_of(given), calib::Matrix3::Identity());
  if (!fitted)
    pattern.fault("", fmt::format("does not determine the bar: {}", fitted.error().text));
}

}  // namespace

bool read_bar_pattern(Section& root, TouchPattern& out, const Faults& faults) {
  Section pattern = root.child("pattern", Need::Required);
  if (!pattern.present()) return false;
  const std::size_t before = faults.count();
  read_hole_axes(pattern, out);
  const bool holes_valid = faults.count() == before;
  read_rod_axes(pattern, out);
  read_touched_places(pattern, out);
  pattern.close();
  if (faults.count() == before) check_determined(pattern, out);
  return holes_valid;
}

}  // namespace abbe::daemon

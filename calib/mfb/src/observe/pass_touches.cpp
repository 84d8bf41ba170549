#include "abbe/calib/internal/mfb/observe/pass_touches.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/mfb/observe/bar_points.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::mfb {
namespace {

std::size_t fewest_of(Feature feature) {
  return feature == Feature::Plane ? kFewestOfPlane : kFewestOfCylinder;
}

/// Checks that every feature has enough touches. A feature with fewer touches in the pattern needs
/// all of them.
Result<void> check_counts(const TouchPattern& pattern, const Measurement& m,
                          const std::vector<bool>& used) {
  const std::vector<NominalTouch> all = nominal_touches(pattern, 0.0);
  for (std::size_t begin = 0; begin < all.size();) {
    const Target& target = all[begin].target;
    const std::size_t planned = pattern.touches_of(target.feature);
    const auto from = used.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto present = static_cast<std::size_t>(
        std::count(from, from + static_cast<std::ptrdiff_t>(planned), true));
    if (const std::size_t fewest = std::min(planned, fewest_of(target.feature)); present < fewest) {
      return failure(ErrorCode::TooFewObservations,
                     message(m.name, ": ", feature_name(target), ": ", present, " of ", planned,
                             " touches, at least ", fewest, " are needed: touch it again"));
    }
    begin += planned;
  }
  return {};
}

void check_radius(double found_m, double nominal_m, const std::string& feature, double limit_m,
                  Result<void>& valid) {
  if (valid && !(std::abs(found_m - nominal_m) <= limit_m)) {
    valid = failure(ErrorCode::NotApplicable,
                    message(feature, ": radius at the centre of the tip ", kMmPerM * found_m,
                            " mm instead of ", kMmPerM * nominal_m,
                            " mm: another bar, a wrong feature or a wrong radius of the tip"));
  }
}

void check_place(const Vector3& found_m, const Vector3& nominal_m, const std::string& feature,
                 double limit_m, Result<void>& valid) {
  if (valid && !((found_m - nominal_m).norm() <= limit_m)) {
    valid = failure(ErrorCode::NotApplicable,
                    message(feature, ": stands at ", mm_text(found_m), " in the axes of the bar, ",
                            "planned ", mm_text(nominal_m), ": another bar or a wrong feature"));
  }
}

}  // namespace

Result<SortedTouches> sorted_touches(const TouchPattern& pattern, const Measurement& m,
                                     const PassTouches& touches) {
  constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  std::vector<std::size_t> row_at(pattern.count(), kNone);
  std::vector<bool> used(pattern.count(), false);
  for (std::size_t row = 0; row < touches.size(); ++row) {
    const Touch& touch = touches[row];
    const std::optional<std::size_t> place = pattern.place_of(touch.target);
    if (!place) {
      return failure(ErrorCode::BadInput, message(m.name, ": ", name(touch.target),
                                                  ": the pattern of the bar has no such touch"));
    }
    if (row_at[*place] != kNone) {
      return failure(ErrorCode::BadInput,
                     message(m.name, ": ", name(touch.target), ": is given twice"));
    }
    if (!touch.reading_m.allFinite()) {
      return failure(ErrorCode::NotFinite,
                     message(m.name, ": ", name(touch.target), ": the reading is not a number"));
    }
    row_at[*place] = row;
    used[*place] = !touch.set_aside;
  }
  ABBE_TRY(check_counts(pattern, m, used));

  SortedTouches sorted;
  const double last = std::max(1.0, static_cast<double>(touches.size()) - 1.0);
  for (std::size_t place = 0; place < used.size(); ++place) {
    if (used[place]) {
      sorted.place.push_back(place);
      sorted.tip_m.emplace_back(touches[row_at[place]].reading_m + m.tool_offset_m);
      sorted.time.push_back(static_cast<double>(row_at[place]) / last);
    }
  }
  return sorted;
}

BarTouches bar_touches(const TouchPattern& p, std::span<const std::size_t> places,
                       std::span<const Vector3> points_m) {
  BarTouches bar;
  bar.holes_m.resize(p.holes());
  bar.rods_m.resize(p.rod_x_m.size());
  bar.planes_m.resize(p.rod_x_m.size());
  const std::size_t hole = p.touches_of(Feature::Hole), rod = p.touches_of(Feature::Rod),
                    plane = p.touches_of(Feature::Plane);
  const std::size_t first_rod = p.holes() * hole, first_plane = first_rod + p.rod_x_m.size() * rod;

  for (std::size_t i = 0; i < places.size(); ++i) {
    const std::size_t place = places[i];
    if (place < first_rod) {
      bar.holes_m[place / hole].push_back(points_m[i]);
    } else if (place < first_plane) {
      bar.rods_m[(place - first_rod) / rod].push_back(points_m[i]);
    } else {
      const std::size_t number = (place - first_plane) / plane;
      bar.planes_m[number / 2][number % 2].push_back(points_m[i]);
    }
  }
  return bar;
}

Result<void> check_features(const BarFeatures& f, const TouchPattern& pattern, double tip_radius_m,
                            const BarPose& pose, const ObserveLimits& limits) {
  const auto in_bar = [&](const Vector3& p_m) {
    return Vector3(pose.axes.transpose() * (p_m - pose.origin_m));
  };
  Result<void> valid;
  for (std::size_t i = 0; i < f.holes.size(); ++i) {
    check_radius(f.holes[i].radius, pattern.hole_radius_m - tip_radius_m, hole_name(i),
                 limits.radius_m, valid);
    Vector3 at = in_bar(f.holes[i].point);
    at.z() = 0.0;
    check_place(at, {pattern.hole_x_m[i], pattern.hole_y_m[i], 0.0}, hole_name(i), limits.place_m,
                valid);
  }
  for (std::size_t j = 0; j < f.rods.size(); ++j) {
    check_radius(f.rods[j].radius, pattern.rod_radius_m + tip_radius_m, rod_name(j),
                 limits.radius_m, valid);
    Vector3 at = in_bar(f.rods[j].point);
    at.y() = 0.0;
    check_place(at, {pattern.rod_x_m[j], 0.0, 0.0}, rod_name(j), limits.place_m, valid);
    for (const Side side : {Side::Left, Side::Right}) {
      const double away_m = (side == Side::Left ? 1.0 : -1.0) * (pattern.plane_y_m + tip_radius_m);
      at = in_bar(f.planes[j][static_cast<std::size_t>(side)].point);
      check_place({0.0, at.y(), 0.0}, {0.0, away_m, 0.0}, plane_name(j, side), limits.place_m,
                  valid);
    }
  }
  return valid;
}

Result<ExtractedBar> extracted(const BarTouches& touches, const Matrix3& axes) {
  Result<BarFeatures> features = fit_features(touches, axes);
  ABBE_TRY(features);
  Result<BarPoints> points = bar_points(*features, axes);
  ABBE_TRY(points);
  return ExtractedBar{*std::move(features), std::move(points->O_m), points->pose};
}

}  // namespace abbe::calib::mfb

#include "abbe/calib/mfb/plan/pass_on_machine.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::mfb {
namespace {

/// Coordinate system with the axes along the bar, across it, and up. Origin: O_1 or the first face.
struct TravelFrame {
  Vector3 origin_m = Vector3::Zero();
  Matrix3 axes = Matrix3::Identity();

  [[nodiscard]] Vector3 to_machine(const Vector3& p) const { return origin_m + axes * p; }
  [[nodiscard]] Vector3 of_machine(const Vector3& p) const {
    return axes.transpose() * (p - origin_m);
  }
};

/// Builds the path of the tip. All places are in the travel frame.
class TouchPath {
 public:
  TouchPath(const TravelFrame& frame, const Vector3& from_m, const MachineTouchOptions& options)
      : frame_(frame), height_m_(options.travel_height_m) {
    out_.push_back(frame.of_machine(from_m));
  }

  /// Begins a feature: the path to its first touch leads up, across and down to `column`, a place
  /// above which the way up is free.
  void go_over_to(const Vector3& column) {
    way_ = std::exchange(out_, {});
    way_.push_back(raised(way_.back()));
    way_.push_back(raised(column));
    way_.push_back(column);
  }
  /// A further corner on the way to the next touch.
  void go_to(const Vector3& corner) {
    if (way_.back() != corner) {
      way_.push_back(corner);
    }
  }

  /// Moves to `before` and touches `at`. `out`: path from `before` to a place above which the way
  /// up is free.
  void touch(const Vector3& before, const Vector3& at, const Vector3& normal,
             std::vector<Vector3> out) {
    go_to(before);
    MachineTouch touch{{}, frame_.to_machine(at), frame_.axes * normal};
    for (const Vector3& p : way_) {
      touch.way_m.push_back(frame_.to_machine(p));
    }
    made_.touches.push_back(std::move(touch));
    way_ = {before};
    out_ = std::move(out);
    out_.insert(out_.begin(), before);
  }

  [[nodiscard]] MachineTouches done() && {
    out_.push_back(raised(out_.back()));
    for (const Vector3& p : out_) {
      made_.leave_m.push_back(frame_.to_machine(p));
    }
    return std::move(made_);
  }

 private:
  [[nodiscard]] Vector3 raised(const Vector3& p) const {
    return {p.x(), p.y(), std::max(p.z(), height_m_)};
  }

  TravelFrame frame_;
  double height_m_;
  MachineTouches made_;
  std::vector<Vector3> way_;  ///< path to the next touch; starts at the place before the latest
                              ///< touch
  std::vector<Vector3> out_;  ///< path from the place before the latest touch out of its feature
};

/// Plans the path of one pass, feature by feature.
class PassPath {
 public:
  PassPath(const Bar& bar, double tip_radius_m, TouchPath path, const MachineTouchOptions& options)
      : bar_(bar), tip_radius_m_(tip_radius_m), options_(options), path_(std::move(path)) {}

  void touch(const NominalTouch& nominal) {
    const bool begins = !feature_ || feature_->feature != nominal.target.feature ||
                        feature_->index != nominal.target.index ||
                        feature_->side != nominal.target.side;
    feature_ = nominal.target;
    const Vector3 &at = nominal.tip_m, &outward = nominal.outward;
    switch (nominal.target.feature) {
      case Feature::Hole:
        return touch_hole(at, -outward, begins);
      case Feature::Rod:
        return touch_rod(at, outward, begins);
      case Feature::Plane:
        return touch_plane(at, outward, begins);
    }
  }

  [[nodiscard]] MachineTouches done() && { return std::move(path_).done(); }

 private:
  /// Touches a hole, starting from its axis.
  void touch_hole(const Vector3& at, const Vector3& normal, bool begins) {
    const TouchPattern& pattern = bar_.pattern;
    const Vector3 before(pattern.hole_x_m[feature_->index], pattern.hole_y_m[feature_->index],
                         at.z());
    if (begins) {
      path_.go_over_to(before);
    }
    path_.touch(before, at, normal, {});
  }

  /// Touches a rod. The tip moves around it on a square across the axis of the rod.
  void touch_rod(const Vector3& at, const Vector3& normal, bool begins) {
    const TouchPattern& pattern = bar_.pattern;
    const double half_m = pattern.rod_radius_m + tip_radius_m_ + options_.clearance_m;
    const double x_m = pattern.rod_x_m[feature_->index];
    const bool from_above = std::abs(normal.x()) < 1e-9 && normal.z() > 0.0;
    const double side = from_above ? 0.0 : std::copysign(1.0, normal.x());
    const Vector3 before = Vector3(x_m, at.y(), 0.0) + half_m * normal;
    const Vector3 beside(x_m + side * half_m, at.y(), before.z());
    const Vector3 above(beside.x(), at.y(), half_m);

    if (begins) {
      path_.go_over_to(above);
    } else {
      path_.go_to(last_beside_);
      path_.go_to(last_above_);
      path_.go_to(Vector3(last_above_.x(), at.y(), half_m));
      path_.go_to(above);
    }
    path_.go_to(beside);
    path_.touch(before, at, normal, {beside, above});
    last_beside_ = beside;
    last_above_ = above;
  }

  void touch_plane(const Vector3& at, const Vector3& normal, bool begins) {
    const Vector3 before = at + options_.clearance_m * normal;
    if (begins) {
      path_.go_over_to(before);
    }
    path_.touch(before, at, normal, {});
  }

  const Bar& bar_;
  double tip_radius_m_;
  MachineTouchOptions options_;
  TouchPath path_;
  std::optional<Target> feature_;
  Vector3 last_beside_ = Vector3::Zero(), last_above_ = Vector3::Zero();
};

Result<void> check(const MachineTouchOptions& o) {
  if (o.clearance_m > 0.0 && o.travel_height_m > 0.0) {
    return {};
  }
  return failure(ErrorCode::BadInput, "clearance and travel height must be positive");
}

Result<void> check_room(const Bar& bar, double tip_radius_m, const MachineTouchOptions& o) {
  const TouchPattern& p = bar.pattern;
  if (o.clearance_m >= p.hole_radius_m - tip_radius_m) {
    return failure(ErrorCode::BadInput,
                   message("clearance ", kMmPerM * o.clearance_m, " mm: a tip of radius ",
                           kMmPerM * tip_radius_m, " mm has at most ",
                           kMmPerM * (p.hole_radius_m - tip_radius_m), " mm in the holes"));
  }
  const double reach_m = p.rod_radius_m + tip_radius_m + o.clearance_m;
  if (o.travel_height_m > reach_m) {
    return {};
  }
  return failure(ErrorCode::BadInput,
                 message("travel height ", kMmPerM * o.travel_height_m, " mm: must be above ",
                         kMmPerM * reach_m, " mm, the path around the rods"));
}

}  // namespace

Result<PassOnMachine> pass_on_machine(const Bar& bar, const Plan& plan, std::size_t measurement,
                                      const Vector3& from_m, const MachineTouchOptions& options) {
  ABBE_TRY(check(plan, bar));
  ABBE_TRY(check(options));
  ABBE_TRY(check_room(bar, plan.tip_radius_m, options));

  const Measurement& m = plan.measurements[measurement];
  const double cosine = m.axes().col(2).dot(plan.measurements.front().axes().col(2));
  constexpr double kParallel = 0.999;
  if (std::abs(cosine) < kParallel) {
    return failure(ErrorCode::BadInput,
                   message(m.name, ": bar_z is neither that of the first pass nor its opposite"));
  }
  const double up = cosine > 0.0 ? 1.0 : -1.0;
  TravelFrame frame{m.origin_m, m.axes()};
  frame.axes.col(2) *= up;

  const std::vector<NominalTouch> nominal = nominal_touches(bar.pattern, plan.tip_radius_m);
  std::vector<std::size_t> order = probing_order(nominal);
  if (m.direction == PassDirection::Backward) {
    std::reverse(order.begin(), order.end());
  }

  PassOnMachine out;
  // The pattern is touched from above also if bar_z points down: its z is counted along "up".
  PassPath path(bar, plan.tip_radius_m, TouchPath(frame, from_m, options), options);
  for (const std::size_t place : order) {
    out.targets.push_back(nominal[place].target);
    path.touch(nominal[place]);
  }
  out.made = std::move(path).done();
  return out;
}

Result<MachineTouches> gauge_on_machine(const StepGauge& gauge, const Measurement& normal,
                                        std::size_t runs, const Vector3& from_m,
                                        const MachineTouchOptions& options) {
  ABBE_TRY(check(options));
  if (runs == 0 || gauge.faces.empty()) {
    return failure(ErrorCode::BadInput, "step gauge: needs at least one face and one run");
  }

  const TravelFrame frame{gauge.origin_m, normal.axes()};
  TouchPath path(frame, from_m, options);
  const Vector3 back = -Vector3::UnitX();
  for (std::size_t run = 0; run < runs; ++run) {
    for (std::size_t i = 0; i < gauge.faces.size(); ++i) {
      const std::size_t face = run % 2 == 0 ? i : gauge.faces.size() - 1 - i;
      const Vector3 at = gauge.faces[face].distance_m * Vector3::UnitX();
      const Vector3 before = at + options.clearance_m * back;
      path.go_over_to(before);
      path.touch(before, at, back, {});
    }
  }
  return std::move(path).done();
}

}  // namespace abbe::calib::mfb

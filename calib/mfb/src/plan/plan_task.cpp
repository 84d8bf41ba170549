#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/mfb/plan/plan.hpp"
#include "plan/plan_place.hpp"

namespace abbe::calib::mfb {
namespace {

Result<void> check_styli(const PlanTask& task) {
  constexpr double kSame_m = 1e-4, kUnit = 1e-6;
  if (task.styli.empty()) {
    return failure(ErrorCode::BadInput, "plan: no stylus is given");
  }
  for (std::size_t i = 0; i < task.styli.size(); ++i) {
    const Stylus& s = task.styli[i];
    if (!s.tool_offset_m.allFinite() || !s.stem.allFinite()) {
      return failure(ErrorCode::NotFinite, "plan: a stylus has a number that is not finite");
    }
    if (std::abs(s.stem.norm() - 1.0) > kUnit) {
      return failure(ErrorCode::BadInput, message("plan: the stem of the stylus ",
                                                  mm_text(s.tool_offset_m), " has no direction"));
    }
    for (std::size_t k = 0; k < i; ++k) {
      if ((task.styli[k].tool_offset_m - s.tool_offset_m).norm() < kSame_m) {
        return failure(ErrorCode::BadInput,
                       message("plan: two styli have the tool offset ", mm_text(s.tool_offset_m)));
      }
    }
  }
  return {};
}

Result<void> check_settings(const PlanTask& task) {
  const TouchNoise& n = task.settings.noise;
  const bool noise = std::isfinite(n.probe_m) && std::isfinite(n.machine_m) && n.probe_m >= 0.0 &&
                     n.machine_m >= 0.0 && n.probe_m + n.machine_m > 0.0;
  if (!noise) {
    return failure(ErrorCode::BadInput,
                   "plan: the noise of probe and machine must not be negative, and not both zero");
  }
  if (!(task.settings.tip_radius_m >= 0.0 &&
        task.settings.tip_radius_m < task.bar.pattern.hole_radius_m)) {
    return failure(ErrorCode::BadInput,
                   message("plan: a tip of radius ", 1e3 * task.settings.tip_radius_m,
                           " mm does not fit into holes of radius ",
                           1e3 * task.bar.pattern.hole_radius_m, " mm"));
  }
  constexpr double kLeastOverlap = 0.1, kMostOverlap = 0.9;
  if (!(task.overlap >= kLeastOverlap && task.overlap <= kMostOverlap)) {
    return failure(ErrorCode::BadInput,
                   message("plan: an overlap of ", task.overlap, ": 0.1 to 0.9 of the bar"));
  }
  return {};
}

Result<void> check_nodes_of(const PlanTask& task) {
  for (const Axis axis : kAllAxes) {
    const std::vector<double>& nodes_m = task.machine.nodes[index(axis)].nodes_m;
    if (nodes_m.size() < 2 || !(nodes_m.back() > nodes_m.front())) {
      return failure(ErrorCode::BadInput, message("plan: axis ", letter(axis), " has no travel"));
    }
  }
  return {};
}

/// Places of O_1 are rounded to this value, so that they are easy to read and set.
constexpr double kRounding_m = 1e-4;

char side_of(const PlanTask& task, const PlannedPosition& position, std::size_t stylus) {
  return task.styli[stylus].stem.dot(position.pose.axes.col(2)) < 0.0 ? '+' : '-';
}

}  // namespace

Stylus stylus_of(const Vector3& tool_offset_m, const KinematicChain& chain) {
  constexpr double kFromAxis_m = 20e-3;
  const auto ram = static_cast<Eigen::Index>(index(chain.order_w_to_t()[2]));
  Vector3 across_m = tool_offset_m;
  across_m(ram) = 0.0;

  Eigen::Index k = ram;
  if (across_m.norm() >= kFromAxis_m) {
    across_m.cwiseAbs().maxCoeff(&k);
  }
  const double sign = tool_offset_m(k) > 0.0 ? 1.0 : -1.0;
  return {tool_offset_m, sign * Vector3::Unit(k)};
}

Result<void> check(const PlanTask& task) {
  for (const auto& one :
       {check(task.bar), check_styli(task), check_settings(task), check_nodes_of(task)}) {
    if (!one) {
      return one;
    }
  }
  return {};
}

ReadingRange readings_of(const Bar& bar, const Plan& plan) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  ReadingRange range{Vector3::Constant(kInfinite), Vector3::Constant(-kInfinite)};
  const std::vector<NominalTouch> touches = nominal_touches(bar.pattern, plan.tip_radius_m);
  for (const Measurement& m : plan.measurements) {
    const Matrix3 axes = m.axes();
    for (const NominalTouch& touch : touches) {
      const Vector3 reading_m = m.origin_m + axes * touch.tip_m - m.tool_offset_m;
      range.min_m = range.min_m.cwiseMin(reading_m);
      range.max_m = range.max_m.cwiseMax(reading_m);
    }
  }
  return range;
}

Plan plan_of(const PlanTask& task, const std::vector<PlannedPosition>& positions) {
  Plan plan = task.settings;
  plan.measurements.clear();
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const PlannedPosition& position = positions[i];
    for (const std::size_t s : position.styli) {
      Measurement m;
      m.name = position.name;
      if (position.styli.size() > 1) {
        m.name += side_of(task, position, s);
      }
      m.position = message('P', i + 1);
      m.origin_m = (position.pose.origin_m / kRounding_m).array().round() * kRounding_m;
      m.bar_x = position.pose.axes.col(0);
      m.bar_z = position.pose.axes.col(2);
      m.tool_offset_m = task.styli[s].tool_offset_m;
      m.temperature_K = task.temperature_K;
      plan.measurements.push_back(m);
      if (task.backward) {
        m.name += " back";
        m.direction = PassDirection::Backward;
        plan.measurements.push_back(m);
      }
    }
  }
  return plan;
}

double duration_s(const Bar& bar, const Plan& plan, const TouchDrive& drive) {
  const std::vector<NominalTouch> touches = nominal_touches(bar.pattern, plan.tip_radius_m);
  // Between two touches the tip moves around the feature; the path is taken as twice the straight
  // distance.
  constexpr double kDetour = 2.0;
  double path_m = bar.pattern.hole_x_m.back();
  for (std::size_t i = 1; i < touches.size(); ++i) {
    if (touches[i].target.feature == touches[i - 1].target.feature &&
        touches[i].target.index == touches[i - 1].target.index) {
      path_m += kDetour * (touches[i].tip_m - touches[i - 1].tip_m).norm();
    }
  }
  const double of_touches_s =
      2.0 * drive.approach_m / drive.probing_feed_m_per_s * static_cast<double>(touches.size());
  return static_cast<double>(plan.measurements.size()) *
         (path_m / drive.feed_m_per_s + of_touches_s);
}

}  // namespace abbe::calib::mfb

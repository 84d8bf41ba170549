#include "abbe/sim/path_motion.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::sim {
namespace {

std::array<int, 3> direction_after(std::array<int, 3> before, const Eigen::Vector3d& unit) {
  for (std::size_t a = 0; a < 3; ++a) {
    const double u = unit[static_cast<Eigen::Index>(a)];
    if (u != 0.0) before[a] = u > 0.0 ? 1 : -1;
  }
  return before;
}

}  // namespace

Result<PathMotion> PathMotion::plan(const PathPlan& plan) {
  if (plan.vertices.empty()) return bad_input("path: no vertex");
  if (!(plan.acceleration_m_per_s2 > 0.0)) return bad_input("path: acceleration must be positive");
  if (!(plan.dwell_s >= 0.0)) return bad_input("path: dwell must not be negative");
  PathMotion motion;
  motion.first_m_ = motion.last_m_ = plan.vertices.front().q_m;
  motion.acceleration_m_per_s2_ = plan.acceleration_m_per_s2;
  std::array<int, 3> direction{};

  for (std::size_t i = 1; i < plan.vertices.size(); ++i) {
    const PathVertex& to = plan.vertices[i];
    const double feed = to.feed_m_per_s > 0.0 ? to.feed_m_per_s : plan.feed_m_per_s;
    if (!(feed > 0.0)) return bad_input("path: feed must be positive");
    const Eigen::Vector3d chord = to.q_m - motion.last_m_;
    if (chord.norm() == 0.0) continue;
    Leg leg;
    leg.from_m = motion.last_m_;
    leg.length_m = chord.norm();
    leg.unit = chord / leg.length_m;
    // A leg too short to reach the feed decelerates from its middle on.
    leg.speed_m_per_s = std::min(feed, std::sqrt(leg.length_m * plan.acceleration_m_per_s2));
    leg.ramp_s = leg.speed_m_per_s / plan.acceleration_m_per_s2;
    leg.cruise_s = leg.length_m / leg.speed_m_per_s - leg.ramp_s;
    leg.begin_s = motion.end_s_ + plan.dwell_s;
    leg.direction_before = direction;
    leg.direction = direction = direction_after(direction, leg.unit);
    motion.end_s_ = leg.begin_s + 2.0 * leg.ramp_s + leg.cruise_s;
    motion.last_m_ = to.q_m;
    motion.legs_.push_back(leg);
  }

  return motion;
}

double PathMotion::leg_end_s(std::size_t i) const {
  return legs_[i].begin_s + 2.0 * legs_[i].ramp_s + legs_[i].cruise_s;
}

AxisMotion PathMotion::on_leg(const Leg& leg, double time_s) const {
  const double a = acceleration_m_per_s2_;
  const double t = time_s - leg.begin_s;
  if (t <= 0.0) return {leg.from_m, Eigen::Vector3d::Zero(), leg.direction_before};
  const double left = 2.0 * leg.ramp_s + leg.cruise_s - t;
  if (left <= 0.0)
    return {leg.from_m + leg.length_m * leg.unit, Eigen::Vector3d::Zero(), leg.direction};
  double s = leg.speed_m_per_s * (t - 0.5 * leg.ramp_s);
  double v = leg.speed_m_per_s;

  if (t < leg.ramp_s) {
    s = 0.5 * a * t * t;
    v = a * t;
  } else if (left < leg.ramp_s) {
    s = leg.length_m - 0.5 * a * left * left;
    v = a * left;
  }

  return {leg.from_m + s * leg.unit, v * leg.unit, leg.direction};
}

AxisMotion PathMotion::at(double time_s) const {
  if (legs_.empty()) return {first_m_, Eigen::Vector3d::Zero(), {}};
  if (time_s >= end_s_) return {last_m_, Eigen::Vector3d::Zero(), legs_.back().direction};
  // The current leg is the first one that has not ended; the dwell before a leg is part of it.
  const auto leg = std::partition_point(legs_.begin(), legs_.end(), [&](const Leg& l) {
    return l.begin_s + 2.0 * l.ramp_s + l.cruise_s <= time_s;
  });
  return on_leg(leg == legs_.end() ? legs_.back() : *leg, time_s);
}

}  // namespace abbe::sim

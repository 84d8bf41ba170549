#include "abbe/sim/path_motion.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/result/try.hpp"

namespace abbe::sim {
namespace {

std::array<int, 3> direction_after(std::array<int, 3> before, const Eigen::Vector3d& unit) {
  for (std::size_t a = 0; a < 3; ++a) {
    const double u = unit[static_cast<Eigen::Index>(a)];
    if (u != 0.0) before[a] = u > 0.0 ? 1 : -1;
  }
  return before;
}

Result<void> check_plan(const PathPlan& plan) {
  if (plan.vertices.empty()) return bad_input("path: no vertex");
  if (!(plan.acceleration_m_per_s2 > 0.0)) return bad_input("path: acceleration must be positive");
  if (!(plan.dwell_s >= 0.0)) return bad_input("path: dwell must not be negative");
  if (!(plan.wait_s >= 0.0)) return bad_input("path: a wait must not be negative");
  return {};
}

/// The vertices of the plan, without those at which the machine already is.
std::vector<PathVertex> vertices_reached(const PathPlan& plan) {
  std::vector<PathVertex> reached{plan.vertices.front()};
  for (const PathVertex& vertex : plan.vertices)
    if ((vertex.q_m - reached.back().q_m).norm() > 0.0) reached.push_back(vertex);
  return reached;
}

}  // namespace

Result<PathMotion> PathMotion::plan(const PathPlan& plan) {
  ABBE_TRY(check_plan(plan));
  const std::vector<PathVertex> vertices = vertices_reached(plan);
  if (plan.wait_s > 0.0 && vertices.size() < 3)
    return bad_input(
        "path: no inner vertex at which the machine can wait for the visits of reference nests; "
        "give a path with three vertices or more, or [sim.tracker] nest_visits = false");

  PathMotion motion;
  motion.first_m_ = motion.last_m_ = vertices.front().q_m;
  motion.acceleration_m_per_s2_ = plan.acceleration_m_per_s2;
  double next_wait_s = 0.0;

  for (std::size_t i = 1; i < vertices.size(); ++i) {
    const double feed_m_per_s =
        vertices[i].feed_m_per_s > 0.0 ? vertices[i].feed_m_per_s : plan.feed_m_per_s;
    if (!(feed_m_per_s > 0.0)) return bad_input("path: feed must be positive");
    double begin_s = motion.end_s_ + plan.dwell_s;
    const bool last = i + 1 == vertices.size();
    if (plan.wait_s > 0.0 && i > 1 && (last || begin_s >= next_wait_s)) {
      motion.waits_s_.push_back(begin_s);
      begin_s += plan.wait_s;
      next_wait_s = begin_s + plan.wait_every_s;
    }
    motion.add_leg(vertices[i], feed_m_per_s, begin_s);
  }

  return motion;
}

void PathMotion::add_leg(const PathVertex& to, double feed_m_per_s, double begin_s) {
  Leg leg;
  leg.from_m = last_m_;
  const Eigen::Vector3d chord = to.q_m - leg.from_m;
  leg.length_m = chord.norm();
  leg.unit = chord / leg.length_m;
  // A leg too short to reach the feed decelerates from its middle on.
  leg.speed_m_per_s = std::min(feed_m_per_s, std::sqrt(leg.length_m * acceleration_m_per_s2_));
  leg.ramp_s = leg.speed_m_per_s / acceleration_m_per_s2_;
  leg.cruise_s = leg.length_m / leg.speed_m_per_s - leg.ramp_s;
  leg.begin_s = begin_s;
  leg.direction_before = legs_.empty() ? std::array<int, 3>{} : legs_.back().direction;
  leg.direction = direction_after(leg.direction_before, leg.unit);
  end_s_ = leg.begin_s + 2.0 * leg.ramp_s + leg.cruise_s;
  last_m_ = to.q_m;
  legs_.push_back(leg);
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

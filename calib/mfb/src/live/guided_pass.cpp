#include "live/guided_pass.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace abbe::calib::mfb {
namespace {

bool same_feature(const Target& a, const Target& b) {
  return a.feature == b.feature && a.index == b.index && a.side == b.side;
}

/// Prior of a pose that is known only from the plan: its limits are two standard deviations.
PosePrior prior_of_plan(const ObserveLimits& limits) {
  return {.shift_m = limits.beside_plan_m / 2.0, .rotation_rad = limits.beside_plan_rad / 2.0};
}

/// Prior of a pose that was already determined with another tool or pass of the same clamping.
constexpr PosePrior kSameClamping{.shift_m = 1e-3, .rotation_rad = 1e-3};

}  // namespace

GuidedPass::GuidedPass(const Measurement& m, const std::vector<NominalTouch>& nominal,
                       const ObserveLimits& limits, const std::optional<PoseOfTouches>& pose)
    : m_(m),
      nominal_(nominal),
      limits_(limits),
      order_(probing_order(nominal)),
      rank_(nominal.size()),
      has_(nominal.size(), false),
      named_(nominal.size(), false),
      reading_m_(nominal.size()) {
  if (m.direction == PassDirection::Backward) {
    std::reverse(order_.begin(), order_.end());
  }
  for (std::size_t i = 0; i < order_.size(); ++i) {
    rank_[order_[i]] = i;
  }
  if (pose) {
    first_pose_ = pose->with_prior(kSameClamping);
  }
  pose_ = first_pose_;
}

Vector3 GuidedPass::planned_m(std::size_t place) const {
  return m_.origin_m + m_.axes() * nominal_[place].tip_m;
}

double GuidedPass::largest_off_m(double off_place_m) const {
  if (pose_) {
    return off_place_m;
  }
  const double lever_m = (planned_m(order_.front()) - m_.origin_m).norm();
  return limits_.beside_plan_m + limits_.beside_plan_rad * lever_m;
}

GuidedPass::Nearest GuidedPass::nearest(const Vector3& reading_m) const {
  const Vector3 tip_m = reading_m + m_.tool_offset_m;
  if (!pose_) {
    return {order_.front(), (tip_m - planned_m(order_.front())).norm()};
  }
  Nearest found{0, std::numeric_limits<double>::infinity()};
  for (std::size_t place = 0; place < nominal_.size(); ++place) {
    const double off_m = (tip_m - pose_->expected_m(planned_m(place))).norm();
    if (off_m < found.off_m) {
      found = {place, off_m};
    }
  }
  return found;
}

void GuidedPass::put(std::size_t place, const Vector3& reading_m) {
  if (!pose_) {
    pose_.emplace(m_.origin_m, prior_of_plan(limits_));
  }
  pose_->add(planned_m(place), m_.axes() * nominal_[place].outward, reading_m + m_.tool_offset_m);
  has_[place] = true;
  reading_m_[place] = reading_m;
  last_ = place;
  touches_.push_back({nominal_[place].target, reading_m, false});
}

void GuidedPass::clear() {
  pose_ = first_pose_;
  std::fill(has_.begin(), has_.end(), false);
  std::fill(named_.begin(), named_.end(), false);
  touches_.clear();
  last_.reset();
}

bool GuidedPass::is_same_place(std::size_t place, const Vector3& reading_m,
                               double same_place_m) const {
  return has_[place] && (reading_m - reading_m_[place]).norm() < same_place_m;
}

std::pair<std::size_t, std::size_t> GuidedPass::count_of_feature(std::size_t place) const {
  std::pair<std::size_t, std::size_t> count{0, 0};
  for (std::size_t i = 0; i < nominal_.size(); ++i) {
    if (same_feature(nominal_[i].target, nominal_[place].target)) {
      count.first += has_[i] ? 1 : 0;
      ++count.second;
    }
  }
  return count;
}

bool GuidedPass::has_enough() const {
  for (std::size_t place = 0; place < nominal_.size(); ++place) {
    const auto [made, planned] = count_of_feature(place);
    const bool plane = nominal_[place].target.feature == Feature::Plane;
    if (made < std::min(planned, plane ? kFewestOfPlane : kFewestOfCylinder)) {
      return false;
    }
  }
  return true;
}

std::size_t GuidedPass::next() const {
  const std::size_t begin = last_ ? rank_[*last_] : 0;
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const std::size_t place = order_[(begin + i) % order_.size()];
    if (!has_[place]) {
      return place;
    }
  }
  return order_.front();
}

bool GuidedPass::is_of_first_feature(std::size_t place) const {
  return same_feature(nominal_[place].target, nominal_[order_.front()].target);
}

std::vector<std::string> GuidedPass::newly_skipped() {
  std::vector<std::string> names;
  for (std::size_t i = 0; last_ && i < rank_[*last_]; ++i) {
    const std::size_t place = order_[i];
    if (has_[place] || named_[place] ||
        same_feature(nominal_[place].target, nominal_[*last_].target)) {
      continue;
    }
    named_[place] = true;
    names.push_back(name(nominal_[place].target));
  }
  return names;
}

}  // namespace abbe::calib::mfb

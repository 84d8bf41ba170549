#include "abbe/calib/probe/observe.hpp"

#include <cmath>
#include <utility>

namespace abbe::calib::probe {
namespace {

bool moves(const RecordedTouch& t) {
  return t.p_m.allFinite() && t.velocity_m_s.allFinite() && t.velocity_m_s.norm() > 0.0;
}

bool meets(const RecordedTouch& touch, const RecordedTouch& other,
           const SamePlaceOptions& options) {
  const Vector3 direction = other.velocity_m_s.normalized();
  if (touch.velocity_m_s.normalized().dot(direction) < options.min_cosine) return false;
  const Vector3 apart = touch.p_m - other.p_m;
  return (apart - apart.dot(direction) * direction).norm() <= options.max_sideways_m;
}

}  // namespace

std::vector<FeedTouch> same_place(std::span<const RecordedTouch> touches,
                                  const SamePlaceOptions& options) {
  std::vector<RecordedTouch> largest;
  for (const RecordedTouch& first : touches) {
    if (!moves(first)) continue;
    std::vector<RecordedTouch> group;
    for (const RecordedTouch& t : touches)
      if (moves(t) && meets(t, first, options)) group.push_back(t);
    if (group.size() > largest.size()) largest = std::move(group);
  }

  Vector3 direction = Vector3::Zero();
  for (const RecordedTouch& t : largest) direction += t.velocity_m_s.normalized();
  std::vector<FeedTouch> out;
  out.reserve(largest.size());
  for (const RecordedTouch& t : largest)
    out.push_back({t.velocity_m_s.norm(), t.p_m.dot(direction.normalized())});

  return out;
}

std::vector<QualifyingTouch> around_sphere(std::span<const RecordedTouch> touches) {
  std::vector<QualifyingTouch> out;
  for (const RecordedTouch& t : touches)
    if (moves(t)) out.push_back({t.p_m, -t.velocity_m_s.normalized()});
  return out;
}

}  // namespace abbe::calib::probe

#include "abbe/sim/followed_motion.hpp"

#include <algorithm>

namespace abbe::sim {
namespace {

constexpr std::chrono::nanoseconds kKept = std::chrono::seconds{2};
constexpr std::chrono::nanoseconds kBeyondNewest = std::chrono::milliseconds{20};
// If the time of a record differs from its arrival by more than this, the control has started
// again.
constexpr std::chrono::nanoseconds kMostDelay = std::chrono::seconds{1};
constexpr double kStands_m = 1e-12;
constexpr std::int64_t kPerGrowth = 10'000;  // the offset grows by 1 / kPerGrowth of the time

std::array<int, 3> direction_of(const Eigen::Vector3d& step_m, std::array<int, 3> before) {
  for (std::size_t a = 0; a < 3; ++a) {
    const double d_m = step_m[static_cast<Eigen::Index>(a)];
    if (std::abs(d_m) > kStands_m) before[a] = d_m > 0.0 ? 1 : -1;
  }
  return before;
}

}  // namespace

HostTime FollowedMotion::time_of(const Place& place) const {
  return HostTime{place.cycle * period_ + offset_};
}

bool FollowedMotion::continues(const protocol::PositionRecord& record, std::int64_t cycle,
                               HostTime arrival) const {
  if (places_.empty() || std::chrono::nanoseconds{record.period_ns} != period_) return false;
  const auto late = arrival.time_since_epoch() - (cycle * period_ + offset_);
  return late > -kMostDelay && late < kMostDelay;
}

// Also called for the first record.
void FollowedMotion::restart(const protocol::PositionRecord& record) {
  if (first_ && homed_) ++counts_.restarts;
  places_.clear();
  period_ = std::chrono::nanoseconds{record.period_ns};
  offset_ = std::chrono::nanoseconds::max();
  newest_cycle_ = record.cycle;
}

void FollowedMotion::add(const protocol::PositionRecord& record, HostTime arrival, bool dated) {
  const std::lock_guard lock(mutex_);
  if (!record.homed) {
    ++counts_.not_homed;
    homed_ = false;
    return;
  }

  // The difference of two numbers of 32 bits is also correct if the number has wrapped to 0.
  const auto step = static_cast<std::int32_t>(record.cycle - newest_number_);
  const std::int64_t cycle = newest_cycle_ + step;
  const bool goes_on = homed_ && continues(record, cycle, arrival);
  if (goes_on && step <= 0) return;  // it arrived after a newer one
  const Eigen::Vector3d q_m = Eigen::Vector3d::Map(record.position_m.data());
  std::array<int, 3> direction{};
  if (goes_on) {
    counts_.lost += static_cast<std::uint64_t>(step - 1);
    newest_cycle_ = cycle;
    offset_ += step * period_ / kPerGrowth;
    direction = direction_of(q_m - places_.back().q_m, places_.back().direction);
  } else {
    restart(record);
  }

  ++counts_.received;
  homed_ = true;
  newest_number_ = record.cycle;
  places_.push_back({newest_cycle_, q_m, direction});
  if (dated || !goes_on)
    offset_ = std::min(offset_, arrival.time_since_epoch() - newest_cycle_ * period_);
  if (!first_) first_ = time_of(places_.back());
  while (time_of(places_.front()) < time_of(places_.back()) - kKept) places_.pop_front();
}

std::optional<AxisMotion> FollowedMotion::at(HostTime at) const {
  const std::lock_guard lock(mutex_);
  if (places_.empty()) return std::nullopt;
  const auto standing = [](const Place& place) {
    return AxisMotion{place.q_m, Eigen::Vector3d::Zero(), place.direction};
  };
  if (places_.size() == 1 || at <= time_of(places_.front())) return standing(places_.front());
  const bool stands = at > time_of(places_.back()) + kBeyondNewest;
  at = std::min(at, time_of(places_.back()) + kBeyondNewest);

  const auto after = std::partition_point(places_.begin() + 1, places_.end() - 1,
                                          [&](const Place& p) { return time_of(p) < at; });
  const Place &to = *after, &from = *(after - 1);
  const double duration_s = ns_to_seconds(time_of(to) - time_of(from));
  const Eigen::Vector3d velocity_m_per_s = (to.q_m - from.q_m) / duration_s;
  return AxisMotion{from.q_m + ns_to_seconds(at - time_of(from)) * velocity_m_per_s,
                    stands ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : velocity_m_per_s,
                    to.direction};
}

std::optional<HostTime> FollowedMotion::first() const {
  const std::lock_guard lock(mutex_);
  return first_;
}

FollowedMotion::Counts FollowedMotion::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

}  // namespace abbe::sim

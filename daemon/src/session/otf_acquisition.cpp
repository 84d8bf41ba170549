#include "abbe/daemon/otf_acquisition.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace abbe::daemon {
namespace {

using protocol::HostTime;
using protocol::SampleFlag;
using protocol::Snapshot;

// Off its leg for longer than this, the machine is on a later one: the beam was away while it turned a
// corner. Shorter than that, only the mapping of the tracker's clock moved.
constexpr auto kCornerMissed = std::chrono::milliseconds{500};

double distance(const AxisPosition& a, const AxisPosition& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/// Nearest point of the leg from `a` to `b`.
struct OnLeg {
  double off_m = 0.0;
  double along_m = 0.0;
};
OnLeg nearest_on_leg(const AxisPosition& q, const AxisPosition& a, const AxisPosition& b) {
  double along = 0.0;
  double length2 = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    along += (q[i] - a[i]) * (b[i] - a[i]);
    length2 += (b[i] - a[i]) * (b[i] - a[i]);
  }
  const double s = length2 > 0.0 ? std::clamp(along / length2, 0.0, 1.0) : 0.0;
  const AxisPosition nearest{a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])};
  return {distance(q, nearest), s * std::sqrt(length2)};
}

double distance_to_path(const AxisPosition& q, const std::vector<AxisPosition>& path) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < path.size(); ++i) {
    nearest = std::min(nearest, nearest_on_leg(q, path[i - 1], path[i]).off_m);
  }
  return nearest;
}

double length(const std::vector<AxisPosition>& path) {
  double sum = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i) sum += distance(path[i - 1], path[i]);
  return sum;
}

std::string text(const AxisPosition& q) {
  return fmt::format("({:.3f}, {:.3f}, {:.3f}) mm", q[0] * 1e3, q[1] * 1e3, q[2] * 1e3);
}

RunPoint run_point(const Snapshot& s) {
  const auto flags = s.tracker_point.head.flags;
  return {.time = s.head.time,
          .device_time = s.tracker_point.device_time,
          .p_tracker_m = s.tracker_point.p_tracker_m,
          .usable = !has(flags, SampleFlag::SpeedExceeded) && !has(flags, SampleFlag::PointInvalid)};
}

bool axes_known(const Snapshot& s) {
  return s.axis_count >= 3 && (s.missing_mask & 0b111) == 0;
}

double seconds(std::chrono::nanoseconds t) {
  return std::chrono::duration<double>(t).count();
}

}  // namespace

OtfAcquisition::OtfAcquisition(std::vector<AxisPosition> path, HostTime from, AcquisitionOptions options)
    : path_(std::move(path)), from_(from), options_(options), path_length_m_(length(path_)) {
  reason_ =
      fmt::format("waiting for the machine to stand at {} with the tracker streaming", text(path_.front()));
}

double OtfAcquisition::progress() const noexcept {
  if (phase_ == Phase::Complete) return 1.0;
  return path_length_m_ > 0.0 ? std::min(driven_m_ / path_length_m_, 1.0) : 0.0;
}

void OtfAcquisition::take(const Snapshot& snapshot) {
  if (!snapshot.has_tracker_point || snapshot.head.time < from_) return;
  const RunPoint point = run_point(snapshot);
  if (phase_ == Phase::Running && point.time - last_time_ > options_.silence) {
    fail(fmt::format("no tracker point for {:.1f} s in the middle of the run",
                     seconds(point.time - last_time_)));
  }
  last_time_ = point.time;
  // Without axis positions the point keeps its place in the sequence, but decides nothing.
  if (!axes_known(snapshot)) {
    if (phase_ == Phase::Running) points_.push_back(point);
    return;
  }
  const AxisPosition q{snapshot.position[0], snapshot.position[1], snapshot.position[2]};
  track_standstill(point, q);
  if (phase_ == Phase::WaitingAtStart)
    wait_at_start(point, q);
  else if (phase_ == Phase::Running)
    run(point, q);
}

void OtfAcquisition::track_standstill(const RunPoint& point, const AxisPosition& q) {
  if (stand_known_ && distance(q, stand_at_) <= options_.stand_tolerance_m) return;
  stand_known_ = true;
  stand_at_ = q;
  stand_since_ = point.time;
}

void OtfAcquisition::wait_at_start(const RunPoint& point, const AxisPosition& q) {
  const bool left_standstill = stand_since_ == point.time;
  const bool stood_long_enough =
      !before_.empty() && before_.back().time - before_.front().time >= options_.stand_before;
  if (left_standstill && stood_long_enough) {
    points_.assign(before_.begin(), before_.end());
    before_.clear();
    phase_ = Phase::Running;
    reason_ = "driving the path";
    on_leg_at_ = point.time;
    points_.push_back(point);
    return;
  }
  if (left_standstill) before_.clear();
  if (distance(q, path_.front()) > options_.vertex_tolerance_m || !point.usable) return;
  before_.push_back(point);
  while (before_.back().time - before_.front().time > options_.keep_before) before_.pop_front();
}

void OtfAcquisition::run(const RunPoint& point, const AxisPosition& q) {
  points_.push_back(point);
  if (const double off_m = distance_to_path(q, path_); off_m > options_.path_tolerance_m) {
    fail(fmt::format(
        "machine at {} is {:.1f} mm away from every leg of the path: another path is being driven", text(q),
        off_m * 1e3));
    return;
  }
  follow_path(point, q);
  if (!complete(point.time, q)) return;
  trim_end();
  phase_ = Phase::Complete;
  reason_ = fmt::format("path driven, {} tracker points", points_.size());
}

void OtfAcquisition::follow_path(const RunPoint& point, const AxisPosition& q) {
  const std::size_t last = path_.size() - 2;
  while (leg_ < last && distance(q, path_[leg_ + 1]) <= options_.vertex_tolerance_m) ++leg_;
  OnLeg here = nearest_on_leg(q, path_[leg_], path_[leg_ + 1]);
  for (std::size_t later = leg_ + 1; here.off_m > options_.path_tolerance_m && later <= last; ++later) {
    if (point.time - on_leg_at_ < kCornerMissed) return;
    const OnLeg there = nearest_on_leg(q, path_[later], path_[later + 1]);
    if (there.off_m > options_.path_tolerance_m) continue;
    leg_ = later;
    here = there;
  }
  if (here.off_m > options_.path_tolerance_m) return;
  on_leg_at_ = point.time;
  const auto behind = static_cast<std::ptrdiff_t>(leg_ + 1);
  driven_m_ = length({path_.begin(), path_.begin() + behind}) + here.along_m;
}

bool OtfAcquisition::complete(HostTime now, const AxisPosition& q) const {
  return leg_ + 2 == path_.size() && distance(q, path_.back()) <= options_.vertex_tolerance_m &&
         now - stand_since_ >= options_.stand_after;
}

void OtfAcquisition::trim_end() {
  const HostTime last = stand_since_ + options_.keep_after;
  while (!points_.empty() && points_.back().time > last) points_.pop_back();
}

void OtfAcquisition::fail(std::string reason) {
  phase_ = Phase::Failed;
  reason_ = std::move(reason);
}

}  // namespace abbe::daemon

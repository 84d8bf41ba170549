#include "abbe/methods/otf/acquisition.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "abbe/config/linear_axes.hpp"
#include "abbe/methods/otf/inputs.hpp"

namespace abbe::daemon {
namespace {

using calib::Vector3;
using protocol::HostTime;
using protocol::SampleFlag;
using protocol::Snapshot;

// If the machine is farther from its leg than the tolerance for longer than this, it is on a later
// leg: the beam was interrupted when the machine passed the corner. For a shorter time, a change in
// the mapping of the tracker's clock can cause such a distance.
constexpr auto kCornerMissed = std::chrono::milliseconds{500};
constexpr auto kMarkEvery = std::chrono::seconds{2};
// A machine that is slower than this over half a minute is at standstill.
constexpr double kSlowest_m_per_s = 0.1e-3;

std::string text(const Vector3& q) {
  return fmt::format("({:.3f}, {:.3f}, {:.3f}) mm", q[0] * 1e3, q[1] * 1e3, q[2] * 1e3);
}

RunPoint run_point(const Snapshot& s) {
  const auto flags = s.tracker_point.head.flags;
  return {
      .time = s.head.time,
      .device_time = s.tracker_point.device_time,
      .p_tracker_m = s.tracker_point.p_tracker_m,
      .usable = !has(flags, SampleFlag::SpeedExceeded) && !has(flags, SampleFlag::PointInvalid)};
}

}  // namespace

void RunPoints::push_back(const RunPoint& point) {
  if (size_ == chunks_.size() * kPointsInChunk)
    chunks_.push_back(std::make_shared<RunPoint[]>(kPointsInChunk));
  chunks_[size_ / kPointsInChunk][size_ % kPointsInChunk] = point;
  ++size_;
}

std::vector<RunPoint> RunPoints::joined() const {
  std::vector<RunPoint> all;
  all.reserve(size_);
  for (std::size_t i = 0; i < full_chunks(); ++i)
    all.insert(all.end(), chunks_[i].get(), chunks_[i].get() + kPointsInChunk);
  const std::vector<RunPoint> last = tail();
  all.insert(all.end(), last.begin(), last.end());
  return all;
}

std::vector<RunPoint> RunPoints::tail() const {
  const std::size_t count = size_ % kPointsInChunk;
  if (count == 0) return {};
  const RunPoint* first = chunks_[full_chunks()].get();
  return {first, first + count};
}

OtfAcquisition::OtfAcquisition(std::vector<AxisPosition> path_m, AcquisitionOptions options,
                               calib::otf::Mode mode)
    : path_m_(std::move(path_m)),
      path_(otf_path(path_m_)),
      driven_at_m_(calib::otf::lengths_to_vertices_m(path_.path())),
      options_(std::move(options)),
      mode_(mode),
      start_({.first_m = path_.path().vertices_m.at(0),
              .second_m = path_.path().vertices_m.at(1),
              .vertex_tolerance_m = options_.vertex_tolerance_m,
              .path_tolerance_m = options_.path_tolerance_m,
              .stand_before = options_.stand_before}),
      reason_(start_.text()) {}

double OtfAcquisition::progress() const noexcept {
  if (phase_ == Phase::Complete) return 1.0;
  return driven_at_m_.back() > 0.0 ? std::min(driven_m_ / driven_at_m_.back(), 1.0) : 0.0;
}

std::optional<std::chrono::nanoseconds> OtfAcquisition::remaining() const noexcept {
  if (phase_ != Phase::Running || marked_ < 2) return std::nullopt;
  const Mark& oldest = marks_[marked_ > marks_.size() ? marked_ % marks_.size() : 0];
  const double speed_m_per_s = (driven_m_ - oldest.driven_m) / in_seconds(on_leg_at_ - oldest.time);
  if (!(speed_m_per_s > kSlowest_m_per_s)) return std::nullopt;
  const std::chrono::duration<double> left{(driven_at_m_.back() - driven_m_) / speed_m_per_s};
  return std::chrono::duration_cast<std::chrono::nanoseconds>(left);
}

void OtfAcquisition::mark_way(HostTime time) {
  if (marked_ > 0 && time - marks_[(marked_ - 1) % marks_.size()].time < kMarkEvery) return;
  marks_[marked_ % marks_.size()] = {time, driven_m_};
  ++marked_;
}

void OtfAcquisition::begin_leg(std::size_t leg, const RunPoint& point, const Vector3& q) {
  begun_leg_ = leg;
  legs_.push_back({.from_m = path_m_[leg],
                   .to_m = path_m_[leg + 1],
                   .first_point = points_.size() - 1,
                   .q_m = {q[0], q[1], q[2]},
                   .p_tracker_m = point.p_tracker_m});
}

RunNews OtfAcquisition::take_news() {
  RunNews news{.chunks = {}, .tail = points_.tail(), .legs = {}, .environment = environment()};
  for (; chunks_taken_ < points_.full_chunks(); ++chunks_taken_)
    news.chunks.push_back(points_.full_chunk(chunks_taken_));
  news.legs.assign(legs_.begin(), legs_.end());
  legs_.clear();
  return news;
}

void OtfAcquisition::take(const Snapshot& snapshot) {
  if (!snapshot.has_tracker_point || snapshot.head.time < from_) return;
  const RunPoint point = run_point(snapshot);
  if (!in_order(point)) return;

  if (phase_ == Phase::Running && point.time - last_time_ > options_.silence) {
    fail(fmt::format("no tracker point for {:.1f} s in the middle of the run",
                     in_seconds(point.time - last_time_)));
  }

  last_time_ = point.time;
  if (has_linear_axes(snapshot)) axes_known_at_ = point.time;
  give_up_if_stuck(point.time);

  // A point without axis positions is kept in its place of the sequence, but not evaluated further.
  const auto flags = snapshot.tracker_point.head.flags;
  const bool settled = !has(flags, SampleFlag::ClockUnsettled);
  if (!has_linear_axes(snapshot)) {
    if (phase_ == Phase::Running) keep(point);
    if (phase_ == Phase::WaitingAtStart) check_start(point, settled, std::nullopt);
    return;
  }

  const Vector3 q{snapshot.position[0], snapshot.position[1], snapshot.position[2]};
  track_standstill(point, q);
  if (phase_ == Phase::WaitingAtStart) {
    compare_with_path(snapshot, q);
    wait_at_start(point, q);
    if (phase_ != Phase::WaitingAtStart) return;
    if (stand_since_ == point.time) readings_.forget();
    check_start(point, settled, q);
  } else if (phase_ == Phase::Running) {
    if (const auto effect = effect_of(snapshot, options_.environment)) environment_.take(*effect);
    temperatures_.take(snapshot);
    run(point, q);
    if (phase_ != Phase::Failed) compare_with_path(snapshot, q);
    if (phase_ == Phase::Complete)
      if (auto contradiction = readings_.contradiction()) fail(*std::move(contradiction));
  }
}

void OtfAcquisition::compare_with_path(const Snapshot& s, const Vector3& q) {
  const auto before = std::exchange(before_q_, std::pair{s.head.time, q});
  if (!before || s.head.time <= before->first) return;
  const double speed_m_per_s =
      (q - before->second).norm() / in_seconds(s.head.time - before->first);
  const auto& vertices = path_.path().vertices_m;

  const auto near = [&](std::size_t i) {
    return (q - vertices[i]).norm() <= options_.vertex_tolerance_m;
  };

  const std::size_t vertex = near(leg_) ? leg_ : leg_ + 1;
  // Near two vertices at once it is not known at which one the machine is; no comparison is made.
  if (!near(vertex) || (vertex == leg_ && near(leg_ + 1)) || (leg_ > 0 && near(leg_ - 1))) return;
  const Vector3& nominal = vertices[vertex];
  const auto effect = effect_of(s, options_.environment);

  if (!effect) return;
  const AxisPosition path_m =
      at_temperature({nominal[0], nominal[1], nominal[2]}, *effect, options_.environment);
  auto contradiction = readings_.take({.vertex = vertex,
                                       .reading_m = q,
                                       .path_m = {path_m[0], path_m[1], path_m[2]},
                                       .u_m = {s.u_position[0], s.u_position[1], s.u_position[2]},
                                       .speed_m_per_s = speed_m_per_s});
  if (contradiction && phase_ != Phase::WaitingAtStart) fail(*std::move(contradiction));
}

void OtfAcquisition::tick(HostTime now) {
  if (phase_ == Phase::Running && now - last_time_ > options_.arrival_time_out) {
    fail(fmt::format("no tracker point for {:.0f} s in the middle of the run",
                     in_seconds(now - last_time_)));
  } else if (phase_ == Phase::WaitingAtStart) {
    give_up_if_stuck(now - options_.arrival_time_out);
    if (phase_ != Phase::WaitingAtStart) return;
    start_.tick(now);
    reason_ = start_.text();
  }
}

void OtfAcquisition::check_start(const RunPoint& point, bool settled,
                                 const std::optional<Vector3>& q) {
  const auto stood =
      before_.empty() ? std::chrono::nanoseconds{} : before_.back().time - before_.front().time;
  start_.take(
      {.time = point.time, .usable = point.usable, .settled = settled, .q_m = q, .stood = stood});
  reason_ = start_.text();
}

/// False if the device time of the point is not later than that of the previous point. Such a point
/// is left out, because the identification needs ascending times.
bool OtfAcquisition::in_order(const RunPoint& point) {
  const auto last = std::exchange(last_device_time_, point.device_time);
  if (!last || point.device_time > *last) return true;
  if (*last - point.device_time > options_.clock_began_anew) {
    before_.clear();
    if (phase_ == Phase::Running) fail("the tracker's clock restarted in the middle of the run");
    return true;
  }
  last_device_time_ = last;
  ++disordered_;
  return false;
}

void OtfAcquisition::give_up_if_stuck(HostTime point_time) {
  if (phase_ == Phase::WaitingAtStart && point_time - from_ > options_.wait_for_start) {
    fail(no_start());
  } else if (phase_ == Phase::Running && point_time - axes_known_at_ > options_.silence) {
    fail(fmt::format("no axis positions for {:.1f} s in the middle of the run",
                     in_seconds(point_time - axes_known_at_)));
  } else if (phase_ == Phase::Running && point_time - stand_since_ > options_.longest_stop) {
    fail(fmt::format("the machine has stood still on its path for {:.0f} min",
                     in_seconds(options_.longest_stop) / 60.0));
  }
}

/// The reason why no run began within wait_for_start.
std::string OtfAcquisition::no_start() const {
  const std::string start = text(path_.path().vertices_m.front());
  const double minutes = in_seconds(options_.wait_for_start) / 60.0;
  const double needed_s = in_seconds(options_.stand_before);

  if (longest_stand_ >= options_.stand_before)
    return fmt::format("the machine did not drive off from {} within {:.0f} min", start, minutes);
  return fmt::format(
      "the machine did not stand at {} for {:.1f} s within {:.0f} min; the longest time was {:.1f} "
      "s",
      start, needed_s, minutes, in_seconds(longest_stand_));
}

void OtfAcquisition::track_standstill(const RunPoint& point, const Vector3& q) {
  if (stand_known_ && (q - stand_at_).norm() <= options_.stand_tolerance_m) return;
  stand_known_ = true;
  stand_at_ = q;
  stand_since_ = point.time;
}

void OtfAcquisition::wait_at_start(const RunPoint& point, const Vector3& q) {
  const bool left_standstill = stand_since_ == point.time;
  const bool stood_long_enough =
      !before_.empty() && before_.back().time - before_.front().time >= options_.stand_before;

  if (left_standstill && stood_long_enough) {
    points_ = {};
    for (const RunPoint& p : before_) points_.push_back(p);
    before_.clear();
    phase_ = Phase::Running;
    reason_ = "driving the path";
    if (const auto& missing = start_.missing_at_start(); !missing.empty())
      reason_ += fmt::format(", begun before READY: {}", missing);
    on_leg_at_ = point.time;
    points_.push_back(point);
    begin_leg(leg_, point, q);
    return;
  }

  if (left_standstill) before_.clear();
  if ((q - path_.path().vertices_m.front()).norm() > options_.vertex_tolerance_m || !point.usable)
    return;
  before_.push_back(point);
  longest_stand_ = std::max(longest_stand_, before_.back().time - before_.front().time);

  while (before_.back().time - before_.front().time > options_.keep_before) before_.pop_front();
}

void OtfAcquisition::keep(const RunPoint& point) {
  points_.push_back(point);
  if (points_.size() < options_.most_points) return;
  fail(
      fmt::format("the run has {} tracker points and does not end: the machine repeats its path, "
                  "or the path is too long for this rate",
                  points_.size()));
}

void OtfAcquisition::run(const RunPoint& point, const Vector3& q) {
  keep(point);
  if (phase_ == Phase::Failed) return;
  if (!path_.first_within(q, options_.path_tolerance_m)) {
    const double off_m = path_.distance_m(q);
    fail(fmt::format(
        "machine at {} is {:.1f} mm away from every leg of the path: another path is being driven",
        text(q), off_m * 1e3));
    return;
  }

  follow_path(point, q);
  if (!complete(point.time, q)) return;
  trim_end();
  phase_ = Phase::Complete;
  reason_ = fmt::format("path driven, {} tracker points", points_.size());
  if (disordered_ > 0) reason_ += fmt::format(", {} out of order left out", disordered_);
}

void OtfAcquisition::follow_path(const RunPoint& point, const Vector3& q) {
  const std::size_t last = path_.path().vertices_m.size() - 2;
  while (leg_ < last &&
         (q - path_.path().vertices_m[leg_ + 1]).norm() <= options_.vertex_tolerance_m)
    ++leg_;

  const auto on_leg = [&](std::size_t leg) {
    return calib::otf::nearest_on_leg(path_.path().vertices_m[leg],
                                      path_.path().vertices_m[leg + 1], q);
  };

  calib::otf::OnLeg here = on_leg(leg_);
  if (here.off_m > options_.path_tolerance_m) {
    if (point.time - on_leg_at_ < kCornerMissed) return;
    const auto later = path_.first_within(q, options_.path_tolerance_m, leg_ + 1);
    if (!later) return;
    leg_ = *later;
    here = on_leg(leg_);
  }

  // Short legs that the machine travelled between two tracker points are added, too, because the
  // direction of travel after them depends on them.
  while (begun_leg_ < leg_) begin_leg(begun_leg_ + 1, point, q);
  on_leg_at_ = point.time;
  driven_m_ = driven_at_m_[leg_] + here.along_m;
  mark_way(point.time);
}

/// True if the run is complete: the machine stands still at the last vertex and is on the last leg,
/// or on a leg from whose end the rest of the path is at most path_tolerance_m long. In the second
/// case the machine may have travelled the last short legs between two tracker points.
bool OtfAcquisition::complete(HostTime now, const Vector3& q) const {
  return driven_at_m_.back() - driven_at_m_[leg_ + 1] <= options_.path_tolerance_m &&
         (q - path_.path().vertices_m.back()).norm() <= options_.vertex_tolerance_m &&
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

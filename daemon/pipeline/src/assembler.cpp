#include "abbe/pipeline/assembler.hpp"

#include "abbe/config/capabilities.hpp"
#include "abbe/pipeline/environment_use.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <span>
#include <utility>

namespace abbe::daemon {
namespace {

// Largest gap between axis samples over which the axes are interpolated, in sample periods: one
// lost sample is bridged, two are not.
constexpr double kMostLostCycles = 2.5;

using protocol::AxisSample;
using protocol::HostTime;
using protocol::SampleFlag;
using protocol::Snapshot;

// Axis samples older than this are discarded. Older samples are needed because a stalled tracker
// later delivers its backlog of points; ten seconds at 1 kHz take 2 MB.
constexpr auto kAxisMemory = std::chrono::seconds{10};

bool earlier(const AxisSample& sample, HostTime t) {
  return sample.head.time < t;
}

void set_axes(Snapshot& s, const drivers::AxesAt& axes) {
  s.axis_count = axes.axis_count;
  s.missing_mask = axes.missing_mask;
  s.head.flags = s.head.flags | axes.flags;
  s.position = axes.position;
  s.velocity = axes.velocity;
  s.u_position = axes.u_position;
}

}  // namespace

AssemblerOptions assembler_options(const Config& config) {
  AssemblerOptions options;
  options.watermark = config.daemon.watermark;
  options.environment = environment_use(config);
  options.axes_compensated = config.axes_compensated();

  if (const auto span = time_of_axis_samples(config, kMostLostCycles))
    options.interpolation.max_span = *span;

  return options;
}

Assembler::Assembler(AssemblerOptions options)
    : options_(std::move(options)), environment_(options_.environment, options_.watermark) {}

void Assembler::take(const Batch& batch) {
  if (batch.taken != HostTime{}) latest_ = batch.taken + options_.watermark;
  const auto advance_to = [&](HostTime t) {
    if (t <= latest_) newest_ = std::max(newest_, t);
  };

  points_.insert(points_.end(), batch.points.begin(), batch.points.end());
  for (const auto& point : batch.points) advance_to(point.head.time);
  for (const AxisSample& sample : batch.axes) {
    advance_to(sample.head.time);
    take(sample);
  }
  environment_.take(batch);
  touches_.insert(touches_.end(), batch.touches.begin(), batch.touches.end());
  for (const auto& touch : batch.touches) advance_to(touch.head.time);
}

/// Inserts the sample by its time: after a bus-off or a restart of the bus, it may be earlier than
/// the sample that arrived before it.
void Assembler::take(const AxisSample& sample) {
  const auto after =
      std::upper_bound(axes_.begin(), axes_.end(), sample.head.time,
                       [](HostTime t, const AxisSample& other) { return t < other.head.time; });
  axes_.insert(after, sample);
}

bool Assembler::ready(HostTime t) const {
  if (newest_ - t > options_.watermark || t > latest_) return true;
  return axes_.size() >= 3 && t <= axes_[axes_.size() - 3].head.time;
}

void Assembler::emit(std::vector<Snapshot>& out) {
  while (!points_.empty() && ready(points_.front().head.time)) emit_first_point(out);
  while (!touches_.empty() && ready(touches_.front().head.time)) emit_first_touch(out);
  forget();
}

void Assembler::finish(std::vector<Snapshot>& out) {
  while (!points_.empty()) emit_first_point(out);
  while (!touches_.empty()) emit_first_touch(out);
}

void Assembler::emit_first_point(std::vector<Snapshot>& out) {
  out.push_back(assemble(points_.front()));
  points_.pop_front();
}

void Assembler::emit_first_touch(std::vector<Snapshot>& out) {
  out.push_back(assemble(touches_.front()));
  touches_.pop_front();
}

Snapshot Assembler::assemble(const protocol::TrackerPoint& point) {
  Snapshot s = begin(point.head);
  s.has_tracker_point = true;
  s.tracker_point = point;
  interpolate(s);
  correct_for_temperature(s, options_.environment);
  correct_for_air(s, options_.environment);
  return s;
}

Snapshot Assembler::assemble(const protocol::ProbeTrigger& touch) {
  Snapshot s = begin(touch.head);
  s.has_trigger = true;
  s.trigger = touch;

  if (touch.axis_count == 0) {
    interpolate(s);
  } else {
    s.axis_count = touch.axis_count;
    s.missing_mask = touch.missing_mask;
    s.position = touch.position;
    s.velocity = touch.velocity;
    s.u_position = touch.u_position;
  }

  // A position that a measuring machine reports is not corrected, because it is not the reading of
  // a scale that abbe knows.
  if (touch.latch != protocol::TouchLatch::Reported)
    correct_for_temperature(s, options_.environment);
  return s;
}

/// Begins a snapshot: its head, and the environment values that apply at the time in the head.
Snapshot Assembler::begin(const protocol::SampleHead& head) {
  Snapshot s;
  s.head = head;
  s.axes_compensated = options_.axes_compensated;
  if (const auto environment = environment_.at(head.time)) {
    s.has_environment = true;
    s.environment = *environment;
  }
  return s;
}

void Assembler::interpolate(Snapshot& s) const {
  // The interpolation uses two samples on either side of the instant. Only these four are passed,
  // so that the result does not depend on which other samples have arrived.
  const auto after = std::lower_bound(axes_.begin(), axes_.end(), s.head.time, earlier);
  const auto first = after - std::min<std::ptrdiff_t>(2, after - axes_.begin());
  const auto end = after + std::min<std::ptrdiff_t>(2, axes_.end() - after);
  std::array<AxisSample, 4> around;
  std::copy(first, end, around.begin());
  const auto axes =
      drivers::interpolate_axes(std::span{around}.first(static_cast<std::size_t>(end - first)),
                                s.head.time, s.head.u_time, options_.interpolation);

  if (axes) {
    set_axes(s, *axes);
  } else {
    s.head.flags |= SampleFlag::AxisMissing;
  }
}

void Assembler::forget() {
  const HostTime oldest = newest_ - kAxisMemory;
  while (axes_.size() > 4 && axes_.front().head.time < oldest) axes_.pop_front();
  environment_.forget(oldest);
}

}  // namespace abbe::daemon

#include "abbe/pipeline/reference_session.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace abbe::daemon {
namespace {

using protocol::AxisSample;
using protocol::HostTime;
using protocol::SampleFlag;

// Axis samples of the counting card are kept for this time, because the mark crossings of the other
// card arrive later.
constexpr auto kMemory = std::chrono::seconds{2};
// Largest spread of the zero as determined from the single marks, in signal periods. With a larger
// spread the scale signals are taken to be faulty, and no zero is given.
constexpr double kMostSpreadPeriods = 0.5;

/// Smallest and largest live count of the samples around [from, to].
std::pair<std::int64_t, std::int64_t> counts_around(const std::deque<AxisSample>& live,
                                                    std::uint8_t axis, HostTime from, HostTime to) {
  const auto after = [](HostTime t, const AxisSample& s) { return t < s.head.time; };
  auto first = std::upper_bound(live.begin(), live.end(), from, after);
  if (first != live.begin()) --first;
  const auto last = std::upper_bound(live.begin(), live.end(), to, after);
  std::int64_t low = first->count[axis];
  std::int64_t high = low;
  for (auto it = first; it != live.end(); ++it) {
    low = std::min(low, it->count[axis]);
    high = std::max(high, it->count[axis]);
    if (it == last) break;
  }
  return {low, high};
}

}  // namespace

ReferenceSession::ReferenceSession(ReferenceOptions options) : options_(std::move(options)) {
  for (const ReferenceAxis& axis : options_.axes)
    axes_.push_back({.options = axis, .traverse = drivers::MarkTraverse{axis.marks}});
}

bool ReferenceSession::finished() const {
  return std::ranges::all_of(
      axes_, [](const Axis& a) { return a.result.state != AxisReference::State::Searching; });
}

void ReferenceSession::restart(Axis& axis) {
  axis.traverse.reset();
  axis.alignment = {};
  axis.zero.reset();
  axis.result.state = AxisReference::State::Searching;
}

void ReferenceSession::take(const AxisSample& live) {
  if (has(live.head.flags, SampleFlag::Restarted)) {
    live_.clear();
    waiting_.clear();
    for (Axis& axis : axes_) restart(axis);
  }
  if (!live_.empty() && live.head.time <= live_.back().head.time) return;
  live_.push_back(live);
  while (live_.front().head.time < live.head.time - kMemory) live_.pop_front();
  process_crossings();
}

void ReferenceSession::take(const drivers::MarkCrossing& crossing) {
  if (has(crossing.head.flags, SampleFlag::Restarted)) {
    waiting_.clear();
    for (Axis& axis : axes_) restart(axis);
  }
  waiting_.push_back(crossing);
  process_crossings();
}

void ReferenceSession::process_crossings() {
  while (!waiting_.empty() && !live_.empty() &&
         live_.back().head.time > waiting_.front().head.time + options_.u_alignment) {
    const drivers::MarkCrossing crossing = waiting_.front();
    waiting_.pop_front();
    for (Axis& axis : axes_)
      if (axis.options.latched_axis == crossing.axis) cross(axis, crossing);
  }
}

/// Passes the axis positions up to `until` to the traverse, as counts of the latching card. While
/// the difference between the zeros of the two counters is not known, no position is passed.
void ReferenceSession::follow(Axis& axis, HostTime until) {
  const auto difference = axis.alignment.difference();
  for (const AxisSample& sample : live_) {
    if (sample.head.time <= axis.followed || sample.head.time > until || !difference) continue;
    axis.traverse.on_position(sample.count[axis.options.live_axis] + std::llround(*difference));
  }
  axis.followed = until;
}

void ReferenceSession::cross(Axis& axis, const drivers::MarkCrossing& crossing) {
  if (axis.result.state != AxisReference::State::Searching) return;
  const HostTime from = crossing.not_before - options_.u_alignment;
  const HostTime to = crossing.head.time + options_.u_alignment;
  if (live_.front().head.time > from) return;  // no position at that time
  follow(axis, from);
  const auto [low, high] = counts_around(live_, axis.options.live_axis, from, to);
  ++axis.result.marks;

  if (!axis.alignment.add(crossing.count, low, high)) {
    axis.result.state = AxisReference::State::Failed;
    axis.result.reason =
        axis.options.name + ": the counts of the two cards do not agree: one of them miscounts";
    return;
  }

  const auto outcome = axis.traverse.on_mark(crossing.count);
  if (outcome && *outcome) axis.zero = **outcome;
  if (outcome && !*outcome) {
    axis.result.reason = axis.options.name + ": " + std::string(name(outcome->error()));
    if (outcome->error() == drivers::MarkFault::WrongScale)
      axis.result.state = AxisReference::State::Failed;
  }

  axis.followed = to;
  conclude(axis);
}

void ReferenceSession::conclude(Axis& axis) {
  if (axis.result.state != AxisReference::State::Searching || !axis.zero) return;
  if (axis.alignment.half_width() > axis.options.max_half_width_counts) {
    axis.result.reason =
        axis.options.name + ": the marks agree; drive slowly over more marks to align the cards";
    return;
  }

  if (axis.zero->spread_periods > kMostSpreadPeriods) return;
  const double per_period = axis.options.marks.counts_per_period;
  const double offset_periods =
      *axis.alignment.difference() / per_period + axis.zero->offset_periods;
  const double u_periods = std::hypot(axis.alignment.half_width() / per_period / std::sqrt(3.0),
                                      axis.zero->spread_periods / std::sqrt(12.0));
  axis.result.state = AxisReference::State::Found;
  axis.result.offset = axis.options.period * offset_periods;
  axis.result.u_offset = axis.options.period * u_periods;
  axis.result.reason.clear();
}

ReferenceOptions reference_options(const ReferenceMarks& found, const CountedAxes& live) {
  ReferenceOptions options{.u_alignment = found.u_alignment};
  for (std::size_t i = 0; i < found.axes.size(); ++i) {
    const AxisMarks& marks = found.axes[i];
    const auto axis = std::ranges::find(live.axes(), marks.axis, &drivers::CounterAxis::name);
    const double along = marks.reversed ? -1.0 : 1.0;
    options.axes.push_back(
        {.name = marks.axis,
         .live_axis = static_cast<std::uint8_t>(axis - live.axes().begin()),
         .latched_axis = static_cast<std::uint8_t>(i),
         .marks = {.code = marks.code,
                   .counts_per_period = along * marks.signal_period / axis->scale},
         .period = marks.signal_period,
         .max_half_width_counts = found.tolerance_m / std::abs(axis->scale)});
  }

  return options;
}

double reading_at_zero(const AxisMarks& marks, const AxisReference& found) {
  return marks.zero_mark + (marks.reversed ? -found.offset : found.offset);
}

}  // namespace abbe::daemon

#include "abbe/daemon/live_view.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>

#include "linear_axes.hpp"

namespace abbe::daemon {

namespace {

using protocol::SampleFlag;

/// Three bursts of a tracker.
constexpr std::chrono::seconds kCurrentFor{1};

/// The message has one instant, that of the axes, and none for the point: of a tracker that lost its beam or
/// its connection the last point would look as fresh as the axes.
void forget_what_is_not_current(protocol::Snapshot& view) {
  const auto old = [&view](const protocol::SampleHead& head) {
    return view.head.time - head.time > kCurrentFor;
  };
  if (view.has_tracker_point && old(view.tracker_point.head)) {
    view.has_tracker_point = false;
    view.tracker_point = {};
  }
  if (view.has_trigger && old(view.trigger.head)) {
    view.has_trigger = false;
    view.trigger = {};
  }
}

}  // namespace

bool axes_known(const protocol::Snapshot& view) noexcept {
  const auto flags = view.head.flags;
  return has_linear_axes(view) && !has(flags, SampleFlag::BusOff) && !has(flags, SampleFlag::DeviceError) &&
         std::all_of(view.position.begin(), view.position.begin() + kLinearAxes,
                     [](double q) { return std::isfinite(q); });
}

bool LiveView::take(const Batch& batch) {
  environment_.take(batch);
  environment_.forget(environment_.newest());
  if (const auto environment = environment_.at(environment_.newest())) {
    view_.has_environment = true;
    view_.environment = *environment;
  }
  for (const auto& sample : batch.axes) take(sample);
  if (!batch.points.empty()) {
    view_.has_tracker_point = true;
    view_.tracker_point = batch.points.back();
    correct_for_air(view_, use_);
    if (!axes_known_at_) view_.head.time = batch.points.back().head.time;
  }
  if (!batch.touches.empty()) {
    view_.has_trigger = true;
    view_.trigger = batch.touches.back();
  }
  forget_what_is_not_current(view_);
  return !batch.axes.empty() || !batch.points.empty() || !batch.touches.empty() ||
         !batch.environment.empty() || !batch.measured_environment.empty();
}

void LiveView::take(const protocol::AxisSample& sample) {
  if (previous_ && previous_->head.time == sample.head.time) return take_back(sample);
  view_.head = sample.head;
  const auto axes = drivers::latest_axes(previous_ ? &*previous_ : nullptr, sample, interpolation_);
  view_.axis_count = axes.axis_count;
  view_.missing_mask = axes.missing_mask;
  view_.position = axes.position;
  view_.velocity = axes.velocity;
  view_.u_position = axes.u_position;
  correct_for_temperature(view_, use_);
  previous_ = sample;
  if (axes_known(view_)) axes_known_at_ = sample.head.time;
}

/// Of two samples of one time the later knows less: the other axes stay as they were.
void LiveView::take_back(const protocol::AxisSample& sample) {
  view_.head.flags |= sample.head.flags;
  view_.missing_mask |= sample.missing_mask;
  for (std::size_t axis = 0; axis < view_.axis_count; ++axis) {
    if ((sample.missing_mask >> axis & 1u) != 0) view_.velocity[axis] = view_.u_position[axis] = 0.0;
  }
  previous_ = sample;
}

}  // namespace abbe::daemon

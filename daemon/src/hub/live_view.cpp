#include "abbe/daemon/live_view.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>

namespace abbe::daemon {

namespace {

using protocol::SampleFlag;

constexpr std::size_t kLinearAxes = 3;
constexpr unsigned kXyz = 0b111;

}  // namespace

bool axes_known(const protocol::Snapshot& view) noexcept {
  const auto flags = view.head.flags;
  return view.axis_count >= kLinearAxes && (view.missing_mask & kXyz) == 0 &&
         !has(flags, SampleFlag::BusOff) && !has(flags, SampleFlag::DeviceError) &&
         std::all_of(view.position.begin(), view.position.begin() + kLinearAxes,
                     [](double q) { return std::isfinite(q); });
}

bool LiveView::take(const Batch& batch) {
  for (const auto& sample : batch.axes) take(sample);
  if (!batch.points.empty()) {
    view_.has_tracker_point = true;
    view_.tracker_point = batch.points.back();
    if (!axes_known_at_) view_.head.time = batch.points.back().head.time;
  }
  if (!batch.environment.empty()) {
    view_.has_environment = true;
    view_.environment = batch.environment.back();
  }
  return !batch.axes.empty() || !batch.points.empty() || !batch.environment.empty();
}

void LiveView::take(const protocol::AxisSample& sample) {
  view_.head = sample.head;
  view_.axis_count = sample.axis_count;
  view_.missing_mask = sample.missing_mask;
  if (previous_) {
    const std::chrono::duration<double> step = sample.head.time - previous_->head.time;
    for (std::size_t a = 0; a < sample.axis_count && step.count() > 0.0; ++a) {
      view_.velocity[a] = (sample.position[a] - previous_->position[a]) / step.count();
      view_.u_position[a] =
          std::abs(view_.velocity[a]) * std::chrono::duration<double>(sample.head.u_time).count();
    }
  }
  view_.position = sample.position;
  previous_ = sample;
  if (axes_known(view_)) axes_known_at_ = sample.head.time;
}

}  // namespace abbe::daemon

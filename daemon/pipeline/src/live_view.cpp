#include "abbe/pipeline/live_view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "abbe/config/linear_axes.hpp"

namespace abbe::daemon {

namespace {

using protocol::SampleFlag;

/// Wall time for which the latest tracker point or touch is shown: three of the bursts in which a
/// tracker delivers points.
constexpr std::chrono::seconds kCurrentFor{1};
}  // namespace

bool axes_known(const protocol::Snapshot& view) noexcept {
  const auto flags = view.head.flags;
  return has_linear_axes(view) && !has(flags, SampleFlag::BusOff) &&
         !has(flags, SampleFlag::DeviceError) &&
         std::all_of(view.position.begin(), view.position.begin() + kLinearAxes,
                     [](double q) { return std::isfinite(q); });
}

LiveView::LiveView(const AssemblerOptions& options, const drivers::TimeSource& time)
    : interpolation_(options.interpolation),
      use_(options.environment),
      environment_(use_, {}),
      current_for_(time.host(kCurrentFor)),
      axes_patience_(time.host(kAxesTimeout)) {
  view_.axes_compensated = options.axes_compensated;
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

  const bool forgotten = forget_what_is_not_current(batch.taken);
  return forgotten || !batch.axes.empty() || !batch.points.empty() || !batch.touches.empty() ||
         !batch.environment.empty() || !batch.measured_environment.empty();
}

void LiveView::take(const protocol::AxisSample& sample) {
  view_.head = sample.head;
  const auto axes = drivers::latest_axes(previous_ ? &*previous_ : nullptr, sample, interpolation_);
  view_.axis_count = axes.axis_count;
  view_.missing_mask = without_reading_ = axes.missing_mask;
  view_.position = axes.position;
  view_.velocity = axes.velocity;
  view_.u_position = axes.u_position;
  correct_for_temperature(view_, use_);
  previous_ = sample;
  if (axes_known(view_)) axes_known_at_ = sample.head.time;
}

std::vector<std::string> LiveView::missing_scales() const {
  std::vector<std::string> reasons(view_.axis_count);
  const auto findings = sensor_findings();
  for (const ThermalAxis& thermal : use_.thermal) {
    const std::size_t channel = thermal.config.temperature;
    const bool known =
        view_.has_environment && std::isfinite(view_.environment.temperature_K[channel]);
    if (thermal.axis >= reasons.size() || known) continue;
    reasons[thermal.axis] = "no value of the temperature of its scale arrives";
    for (const SensorFinding& finding : findings)
      if (std::ranges::find(finding.axes, thermal.config.axis) != finding.axes.end())
        reasons[thermal.axis] = finding.text;
  }
  return reasons;
}

std::string LiveView::why_scales_alone_are_missing() const {
  constexpr unsigned kXYZ = (1u << kLinearAxes) - 1u;
  const auto flags = view_.head.flags;
  if ((without_reading_ & kXYZ) != 0 || has(flags, SampleFlag::BusOff) ||
      has(flags, SampleFlag::DeviceError))
    return {};
  const auto reasons = missing_scales();
  std::string all;
  for (const ThermalAxis& thermal : use_.thermal)
    if (thermal.axis < std::min(kLinearAxes, reasons.size()) && !reasons[thermal.axis].empty())
      all += fmt::format("{}{}: {}", all.empty() ? "" : "; ", thermal.config.axis,
                         reasons[thermal.axis]);
  return all;
}

/// Removes a tracker point and a touch that are older than kCurrentFor. The published message has a
/// single instant, that of the axes: after the tracker has lost its beam or connection, its last
/// point would otherwise appear to be as new as the axes.
bool LiveView::forget_what_is_not_current(protocol::HostTime now) {
  bool forgotten = false;
  const auto forget = [&](bool& has, auto& sample) {
    if (!has || now - sample.head.time <= current_for_) return;
    has = false;
    sample = {};
    forgotten = true;
  };
  forget(view_.has_tracker_point, view_.tracker_point);
  forget(view_.has_trigger, view_.trigger);
  return mark_axes_missing(now) || forgotten;
}

/// Marks all axes missing if no axis sample has come for too long. Their last positions stay in the
/// view, but missing_mask shows that they are not current.
bool LiveView::mark_axes_missing(protocol::HostTime now) {
  if (!previous_ || now - previous_->head.time <= axes_patience_) return false;
  const auto all = static_cast<std::uint8_t>((1u << view_.axis_count) - 1u);
  without_reading_ = all;
  if (view_.missing_mask == all) return false;
  view_.missing_mask = all;
  view_.head.flags |= SampleFlag::AxisMissing;
  view_.velocity = view_.u_position = {};
  return true;
}

}  // namespace abbe::daemon

#include "abbe/daemon/reference_service.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::daemon {

ReferenceOptions reference_options(const ReferenceConfig& config, const CounterCardConfig& live) {
  ReferenceOptions options{.u_alignment = config.u_alignment};
  for (std::size_t i = 0; i < config.axes.size(); ++i) {
    const ReferenceAxisConfig& marks = config.axes[i];
    const auto axis = std::ranges::find(live.wiring.axes, marks.axis, &drivers::CounterAxis::name);
    const double along = marks.reversed ? -1.0 : 1.0;
    options.axes.push_back(
        {.name = marks.axis,
         .live_axis = static_cast<std::uint8_t>(axis - live.wiring.axes.begin()),
         .latched_axis = static_cast<std::uint8_t>(i),
         .marks = {.code = marks.code, .counts_per_period = along * marks.signal_period / axis->scale},
         .period = marks.signal_period,
         .max_half_width_counts = config.tolerance_m / std::abs(axis->scale)});
  }
  return options;
}

double reading_at_zero(const ReferenceAxisConfig& marks, const AxisReference& found) {
  return marks.zero_mark + (marks.reversed ? -found.offset : found.offset);
}

ReferenceService::ReferenceService(const Config& config, RecorderThread* recorder)
    : config_(config), recorder_(recorder), datum_(config) {}

Result<void> ReferenceService::start() {
  if (!configured())
    return fail(ErrorCode::Refused, "reference: there is no [reference] in the configuration");
  if (running_) return fail(ErrorCode::Refused, "reference: a search for the marks is running already");
  session_.emplace(reference_options(*config_.reference, *config_.counter_card));
  taken_up_.assign(config_.reference->axes.size(), false);
  running_ = true;
  from_ = newest_;
  if (recorder_ != nullptr) recorder_->attach(reference_request(newest_), newest_);
  return {};
}

Result<void> ReferenceService::cancel() {
  if (!running_) return fail(ErrorCode::Refused, "reference: no search for the marks is running");
  running_ = false;
  return {};
}

void ReferenceService::turn(Batch& batch) {
  for (const auto& sample : batch.axes) newest_ = std::max(newest_, sample.head.time);
  if (running_) look_for_marks(batch);
  datum_.apply(batch);
}

void ReferenceService::look_for_marks(const Batch& batch) {
  for (const auto& crossing : batch.marks)
    if (crossing.head.time > from_) session_->take(crossing);
  for (const auto& sample : batch.axes) session_->take(sample);
  for (std::size_t i = 0; i < taken_up_.size(); ++i) {
    const bool found = session_->axis(i).state == AxisReference::State::Found;
    if (found && !taken_up_[i]) take_up(i);
    taken_up_[i] = found;  // not any more if the card began anew
  }
  if (session_->finished()) running_ = false;
}

void ReferenceService::take_up(std::size_t axis) {
  const FoundDatum datum{.axis = session_->options().axes[axis].live_axis,
                         .reading_at_zero = reading_at_zero(axis),
                         .u = session_->axis(axis).u_offset,
                         .from = newest_};
  datum_.found(datum);
  if (recorder_ != nullptr) recorder_->attach(to_attachment(datum), newest_);
}

double ReferenceService::reading_at_zero(std::size_t axis) const {
  return daemon::reading_at_zero(config_.reference->axes[axis], session_->axis(axis));
}

std::vector<ReferenceService::AxisStatus> ReferenceService::status() const {
  std::vector<AxisStatus> all;
  if (!configured()) return all;
  const auto options = reference_options(*config_.reference, *config_.counter_card);
  for (std::size_t i = 0; i < options.axes.size(); ++i) {
    AxisStatus& axis = all.emplace_back();
    axis.name = options.axes[i].name;
    axis.known = datum_.known(options.axes[i].live_axis);
    if (!session_) continue;
    axis.found = session_->axis(i);
    if (axis.found.state == AxisReference::State::Found) axis.reading_at_zero = reading_at_zero(i);
  }
  return all;
}

}  // namespace abbe::daemon

#include "abbe/service/reference_service.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;

constexpr auto kStandsFor = 500ms;
// positions (m or rad) of an axis in position control scatter by less than this
constexpr double kStill = 2e-6;
constexpr double kStillCounts = 2.0;  // an axis at rest may change by this many counts

}  // namespace

ReferenceService::ReferenceService(const Config& config, RecorderThread* recorder,
                                   std::optional<Counting> left)
    : config_(config),
      counted_(counted_axes(config)),
      marks_(reference_marks(config)),
      recorder_(recorder),
      zeros_(config),
      left_(std::move(left)) {}

Result<void> ReferenceService::start() {
  if (!configured())
    return fail(ErrorCode::Refused, fmt::format("reference: there is no {} in the configuration",
                                                tables_with(Capability::Marks)));
  if (running_)
    return fail(ErrorCode::Refused, "reference: a search for the marks is running already");
  session_.emplace(reference_options(*marks_, *counted_));
  zero_used_.assign(marks_->axes.size(), false);
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

void ReferenceService::on_delivered(const Batch& batch) {
  if (left_ && !batch.axes.empty()) use_zeros_left(batch.axes.front());
  for (const auto& sample : batch.axes) {
    if (has(sample.head.flags, protocol::SampleFlag::Restarted)) {
      restarted_at_ = sample.head.time;
      progress_.reset();
    }
    newest_ = std::max(newest_, sample.head.time);
    watch_standing(sample);
  }
  if (!batch.axes.empty()) latest_ = batch.axes.back();
  if (running_) look_for_marks(batch);
}

/// Takes over the zero of every axis from the previous run, if the counters have continued. These
/// zeros are recorded in the same way as at the start of a further recording file.
void ReferenceService::use_zeros_left(const protocol::AxisSample& first) {
  const Counting left = *std::exchange(left_, std::nullopt);
  if (has(first.head.flags, protocol::SampleFlag::Restarted)) return;
  const ZeroState nothing_known{.at = first.head.time - 1ns, .unknown = 0xff};
  newest_ = first.head.time;
  zeros_.go_on(nothing_known);
  if (recorder_ != nullptr) recorder_->attach(to_attachment(nothing_known), newest_);
  for (FoundZero zero : left.zero) {
    zero.from = nothing_known.at;
    use_zero(zero);
    carried_on_.push_back(counted_->axes()[zero.axis].name);
  }
}

/// Takes a state of the counters. If it is later than the newest sample, it waits: a sample that
/// shows a restart of the counters must be taken before a state after this restart.
void ReferenceService::take(const std::optional<CountingProgress>& progress) {
  if (progress) coming_ = progress;
  if (!coming_ || coming_->head.time > newest_) return;
  if (coming_->head.time >= restarted_at_) progress_ = coming_;
  coming_.reset();
}

std::optional<Counting> ReferenceService::counting() const {
  if (!progress_) return std::nullopt;
  return Counting{.progress = *progress_, .zero = zeros_.current()};
}

void ReferenceService::look_for_marks(const Batch& batch) {
  for (const auto& crossing : batch.marks)
    if (crossing.head.time > from_) session_->take(crossing);
  for (const auto& sample : batch.axes) session_->take(sample);
  for (std::size_t i = 0; i < zero_used_.size(); ++i) {
    const bool found = session_->axis(i).state == AxisReference::State::Found;
    if (found && !zero_used_[i]) use_zero(i);
    zero_used_[i] = found;  // it becomes false after a restart of the card
  }
  if (session_->finished()) running_ = false;
}

void ReferenceService::use_zero(std::size_t axis) {
  const FoundZero zero{.axis = session_->options().axes[axis].live_axis,
                       .reading_at_zero = reading_at_zero(axis),
                       .u = session_->axis(axis).u_offset,
                       .from = newest_};
  use_zero(zero);
}

void ReferenceService::use_zero(const FoundZero& zero) {
  zeros_.found(zero);
  if (recorder_ != nullptr) recorder_->attach(to_attachment(zero), newest_);
}

std::vector<std::string> ReferenceService::without_marks() const {
  std::vector<std::string> names;
  if (!counted_) return names;
  for (const auto& axis : counted_->axes())
    if (!has_marks(config_, axis.name)) names.push_back(axis.name);
  return names;
}

std::vector<std::string> ReferenceService::unknown() const {
  std::vector<std::string> names;
  if (!counted_) return names;
  const auto& axes = counted_->axes();
  for (std::size_t i = 0; i < axes.size(); ++i)
    if (!zeros_.known(i)) names.push_back(axes[i].name);
  return names;
}

std::vector<std::string> ReferenceService::without_zero() const {
  auto names = unknown();
  std::erase_if(names, [this](const std::string& name) { return has_marks(config_, name); });
  return names;
}

void ReferenceService::watch_standing(const protocol::AxisSample& sample) {
  if (!counted_) return;
  const auto& live = counted_->axes();
  const bool restarted =
      standing_.empty() || has(sample.head.flags, protocol::SampleFlag::Restarted);
  standing_.resize(live.size());
  for (std::size_t i = 0; i < live.size(); ++i) {
    const double most = std::max(kStillCounts, kStill / std::abs(live[i].scale));
    const double moved = std::abs(static_cast<double>(sample.count[i] - standing_[i].count));
    if (restarted || moved > most) standing_[i] = {sample.count[i], sample.head.time};
  }
}

Result<void> ReferenceService::check_standing(std::size_t axis) const {
  const auto& name = counted_->axes()[axis].name;
  if ((latest_->missing_mask >> axis & 1u) != 0)
    return fail(ErrorCode::Refused,
                fmt::format("reference: the counter card does not count axis {} now", name));
  if (newest_ - standing_[axis].since < kStandsFor)
    return fail(
        ErrorCode::Refused,
        fmt::format(
            "reference: axis {} moves, or has stood for less than {} ms: wait until it stands",
            name, kStandsFor.count()));
  return {};
}

Result<void> ReferenceService::set_zero_here(const SetZeroHere& here) {
  const auto possible = without_marks();
  for (const auto& name : here.axes)
    if (std::ranges::find(possible, name) == possible.end())
      return fail(ErrorCode::Usage,
                  fmt::format("reference: axis {} has marks, or no card counts it", name));
  if (possible.empty())
    return fail(ErrorCode::Usage, "reference: no axis without reference marks is configured");
  if (!(here.u > 0.0) || !std::isfinite(here.u))
    return fail(ErrorCode::Usage, "reference: the uncertainty of the zero must be positive");
  if (here.acquiring)
    return fail(
        ErrorCode::Refused,
        "reference: a calibration takes readings: a new zero would make them inconsistent; wait "
        "until it has ended, or cancel it");
  if (!latest_)
    return fail(ErrorCode::Refused, "reference: the counter card has not delivered a sample yet");
  if (here.now - newest_ > here.patience)
    return fail(ErrorCode::Refused,
                fmt::format("reference: the counter card has been silent for {:.1f} s",
                            std::chrono::duration<double>(here.now - newest_).count()));
  const auto& live = counted_->axes();
  std::vector<std::size_t> places;

  for (const auto& name : here.axes.empty() ? possible : here.axes) {
    places.push_back(static_cast<std::size_t>(
        std::ranges::find(live, name, &drivers::CounterAxis::name) - live.begin()));
    ABBE_TRY(check_standing(places.back()));
  }

  for (const std::size_t place : places) {
    const double counted = live[place].scale * static_cast<double>(latest_->count[place]);
    use_zero(FoundZero{.axis = place,
                       .reading_at_zero = live[place].offset - counted,
                       .u = here.u,
                       .from = newest_,
                       .stated = true});
  }

  return {};
}

double ReferenceService::reading_at_zero(std::size_t axis) const {
  return daemon::reading_at_zero(marks_->axes[axis], session_->axis(axis));
}

std::vector<ReferenceService::AxisStatus> ReferenceService::status() const {
  std::vector<AxisStatus> all;
  if (!configured()) return all;
  const auto options = reference_options(*marks_, *counted_);
  for (std::size_t i = 0; i < options.axes.size(); ++i) {
    AxisStatus& axis = all.emplace_back();
    axis.name = options.axes[i].name;
    axis.known = zeros_.known(options.axes[i].live_axis);
    if (!session_) continue;
    axis.found = session_->axis(i);
    if (axis.found.state == AxisReference::State::Found) axis.reading_at_zero = reading_at_zero(i);
  }
  return all;
}

}  // namespace abbe::daemon

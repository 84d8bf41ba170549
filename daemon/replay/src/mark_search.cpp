#include "mark_search.hpp"

#include "abbe/config/capabilities.hpp"
#include "abbe/pipeline/axis_zero.hpp"
#include "abbe/pipeline/reference_session.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

using protocol::HostTime;

namespace {

HostTime began_after(const RecordingReader& recording) {
  for (const auto& attachment : recording.attachments())
    if (attachment.name == kZeroStateName)
      if (const auto state = zero_state_from_attachment(attachment)) return state->at;
  return HostTime::min();
}

}  // namespace

MarkSearch::MarkSearch(const Config& config) : marks_(reference_marks(config)) {
  const auto counted = counted_axes(config);
  if (marks_ != nullptr && counted) options_ = reference_options(*marks_, *counted);
  axes_.resize(options_.axes.size());
}

Result<MarkSearch> MarkSearch::of(const RecordingReader& recording, const Config& config) {
  MarkSearch search(config);
  for (const auto& attachment : recording.attachments()) {
    if (attachment.name != kReferenceRequestName) continue;
    const auto from = reference_request_from(attachment);
    ABBE_TRY(from);
    search.requests_.push_back(*from);
  }
  return search;
}

void MarkSearch::take(const Batch& batch) {
  for (const auto& crossing : batch.marks) take(crossing, crossing.head.time);
  for (const auto& sample : batch.axes) take(sample, sample.head.time);
}

template <class Sample>
void MarkSearch::take(const Sample& sample, HostTime time) {
  if (axes_.empty()) return;
  for (; next_ < requests_.size() && time > requests_[next_]; ++next_) begin();
  // A batch of the replay may begin earlier than in the live run. Samples from before the request
  // are skipped, because the live search did not get them.
  if (!session_ || time <= requests_[next_ - 1] || session_->finished()) return;
  session_->take(sample);
  for (std::size_t i = 0; i < axes_.size(); ++i) note(i);
}

void MarkSearch::begin() {
  session_.emplace(options_);
  for (Axis& axis : axes_) axis.found = false;
}

void MarkSearch::note(std::size_t i) {
  const bool found = session_->axis(i).state == AxisReference::State::Found;
  if (found && !axes_[i].found)
    axes_[i].readings.push_back(reading_at_zero(marks_->axes[i], session_->axis(i)));
  axes_[i].found = found;
}

std::vector<ReplayedZero> MarkSearch::compared(const RecordingReader& recording) const {
  std::vector<ReplayedZero> all;
  std::vector<std::size_t> seen(axes_.size(), 0);
  const HostTime begun = began_after(recording);

  for (const auto& attachment : recording.attachments()) {
    if (attachment.name != kZeroName) continue;
    const auto live = zero_from_attachment(attachment);
    if (live && live->from < begun) continue;  // this zero was found in an earlier file
    for (std::size_t i = 0; live && i < axes_.size(); ++i) {
      if (options_.axes[i].live_axis != live->axis) continue;
      ReplayedZero& zero = all.emplace_back();
      zero.axis = options_.axes[i].name;
      zero.live = live->reading_at_zero;
      if (seen[i] < axes_[i].readings.size()) zero.again = axes_[i].readings[seen[i]++];
    }
  }

  return all;
}

}  // namespace abbe::daemon

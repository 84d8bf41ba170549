#include "abbe/pipeline/axis_zero.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/messages/attachment_content.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;
using protocol::SampleFlag;

template <class Sample>
void set_missing(Sample& sample, std::size_t axis) {
  sample.missing_mask = static_cast<std::uint8_t>(sample.missing_mask | 1u << axis);
  sample.head.flags |= SampleFlag::AxisMissing;
}

}  // namespace

bool has_marks(const Config& config, const std::string& axis) {
  const ReferenceMarks* const marks = reference_marks(config);
  return marks != nullptr &&
         std::ranges::find(marks->axes, axis, &AxisMarks::axis) != marks->axes.end();
}

AxisZeros::AxisZeros(const Config& config, WithoutMarks without_marks) {
  const auto counted = counted_axes(config);
  if (!counted) return;
  const auto& live = counted->axes();
  for (std::size_t i = 0; i < live.size(); ++i) {
    const bool marks = has_marks(config, live[i].name);
    if (!marks && without_marks == WithoutMarks::Untouched) continue;
    Axis& axis = axes_.emplace_back();
    axis.place = i;
    axis.step = live[i].scale;
    axis.offset = live[i].offset;
    axis.zero_is_here = !marks && counted->zero_is_here;
    if (axis.zero_is_here) axis.current = FoundZero{.axis = i, .reading_at_zero = axis.offset};
  }
}

void AxisZeros::go_on(const ZeroState& state) {
  begun_ = true;
  for (Axis& axis : axes_) {
    if ((state.unknown >> axis.place & 1u) == 0) continue;
    axis.current.reset();
    std::erase_if(axis.coming, [&state](const FoundZero& found) { return found.from < state.at; });
  }
}

void AxisZeros::found(const FoundZero& zero) {
  for (Axis& axis : axes_)
    if (axis.place == zero.axis) axis.coming.push_back(zero);
}

bool AxisZeros::known(std::size_t place) const {
  const auto axis = std::ranges::find(axes_, place, &Axis::place);
  return axis == axes_.end() || axis->current || !axis->coming.empty();
}

std::vector<FoundZero> AxisZeros::current() const {
  std::vector<FoundZero> all;
  for (const Axis& axis : axes_)
    if (axis.current) all.push_back(*axis.current);
  return all;
}

void AxisZeros::move_on(const protocol::SampleHead& head) {
  for (Axis& axis : axes_) {
    while (!axis.coming.empty() && axis.coming.front().from < head.time) {
      axis.current = axis.coming.front();
      axis.coming.pop_front();
    }
    const bool first_set_up = !begun_ && axis.zero_is_here;
    if (has(head.flags, SampleFlag::Restarted) && !first_set_up) axis.current.reset();
  }
  begun_ = true;
}

template <class Counted>
void AxisZeros::apply_to_counts(Counted& sample) const {
  for (const Axis& axis : axes_) {
    if (axis.current) {
      sample.position[axis.place] =
          axis.current->reading_at_zero + axis.step * static_cast<double>(sample.count[axis.place]);
    } else {
      set_missing(sample, axis.place);
    }
  }
}

void AxisZeros::apply(protocol::AxisSample& sample) {
  move_on(sample.head);
  apply_to_counts(sample);
}

void AxisZeros::apply(protocol::ProbeTrigger& touch) const {
  for (const Axis& axis : axes_) {
    if (axis.current) {
      touch.position[axis.place] += axis.current->reading_at_zero - axis.offset;
    } else {
      set_missing(touch, axis.place);
    }
  }
}

void AxisZeros::apply(Batch& batch) {
  if (axes_.empty()) return;
  for (auto& sample : batch.axes) apply(sample);
  for (auto& touch : batch.touches) apply(touch);
  for (auto& scan : batch.touch_scans) apply_to_counts(scan);
}

RecordingAttachment to_attachment(const FoundZero& zero) {
  const json content{{"axis", zero.axis},
                     {"reading_at_zero", zero.reading_at_zero},
                     {"u", zero.u},
                     {"stated", zero.stated},
                     {"from_ns", zero.from.time_since_epoch().count()}};
  return {.name = std::string{kZeroName},
          .media_type = "application/json",
          .content = json_text(content)};
}

RecordingAttachment to_attachment(const ZeroState& state) {
  return {.name = std::string{kZeroStateName},
          .media_type = "application/json",
          .content = json_text(
              json{{"at_ns", state.at.time_since_epoch().count()}, {"unknown", state.unknown}})};
}

Result<ZeroState> zero_state_from_attachment(const RecordingAttachment& attachment) {
  try {
    const auto parsed = content_of(attachment);
    ABBE_TRY(parsed);
    const json& content = *parsed;
    return ZeroState{
        .at = protocol::HostTime{std::chrono::nanoseconds{content.at("at_ns").get<std::int64_t>()}},
        .unknown = content.at("unknown").get<std::uint8_t>()};
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput,
                fmt::format("attachment {}: {}", attachment.name, cause_of(e)));
  }
}

RecordingAttachment reference_request(protocol::HostTime from) {
  return {.name = std::string{kReferenceRequestName},
          .media_type = "application/json",
          .content = json_text(json{{"from_ns", from.time_since_epoch().count()}})};
}

Result<protocol::HostTime> reference_request_from(const RecordingAttachment& attachment) {
  try {
    const auto content = content_of(attachment);
    ABBE_TRY(content);
    const auto ns = content->at("from_ns").get<std::int64_t>();
    return protocol::HostTime{std::chrono::nanoseconds{ns}};
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput,
                fmt::format("attachment {}: {}", attachment.name, cause_of(e)));
  }
}

Result<FoundZero> zero_from_attachment(const RecordingAttachment& attachment) {
  try {
    const auto parsed = content_of(attachment);
    ABBE_TRY(parsed);
    const json& content = *parsed;
    return FoundZero{
        .axis = content.at("axis").get<std::size_t>(),
        .reading_at_zero = content.at("reading_at_zero").get<double>(),
        .u = content.at("u").get<double>(),
        .from =
            protocol::HostTime{std::chrono::nanoseconds{content.at("from_ns").get<std::int64_t>()}},
        .stated = content.value("stated", false)};
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput,
                fmt::format("attachment {}: {}", attachment.name, cause_of(e)));
  }
}

}  // namespace abbe::daemon

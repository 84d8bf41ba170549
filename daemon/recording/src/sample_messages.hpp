#pragma once
/// Converts samples to the IDL types and back, field by field.

#include <string_view>

#include "abbe/protocol/samples.hpp"
#include "abbe_v1.h"

namespace abbe::daemon::recording {

/// The fill() functions write into an existing message, so that the memory of its strings and
/// sequences is reused.
void fill(v1::TrackerPoint& message, const protocol::TrackerPoint& point, std::string_view device);
void fill(v1::AxisSample& message, const protocol::AxisSample& sample, std::string_view device);
void fill(v1::ProbeTrigger& message, const protocol::ProbeTrigger& touch, std::string_view device);
void fill(v1::TouchScan& message, const protocol::TouchScan& scan, std::string_view device);
void fill(v1::EnvironmentSample& message, const protocol::EnvironmentSample& sample,
          std::string_view device);

[[nodiscard]] protocol::TrackerPoint sample_of(const v1::TrackerPoint& message);
[[nodiscard]] protocol::AxisSample sample_of(const v1::AxisSample& message);
[[nodiscard]] protocol::ProbeTrigger sample_of(const v1::ProbeTrigger& message);
[[nodiscard]] protocol::TouchScan sample_of(const v1::TouchScan& message);
[[nodiscard]] protocol::EnvironmentSample sample_of(const v1::EnvironmentSample& message);

/// Marks in `message` that `lost` messages of the same stream are missing before it.
template <class Message>
void mark_gap(Message& message, std::uint32_t lost) {
  message.flags(message.flags() | protocol::SampleFlag::GapBefore);
  if constexpr (requires { message.lost_before(); })
    message.lost_before(message.lost_before() + lost);
}

/// Number of messages that are missing before `message`. `marked`: the number that mark_gap() has
/// added; it is the result for kinds of messages that have no field lost_before.
template <class Message>
[[nodiscard]] std::uint32_t lost_before(const Message& message, std::uint32_t marked) {
  if constexpr (requires { message.lost_before(); })
    return message.lost_before();
  else
    return marked;
}

}  // namespace abbe::daemon::recording

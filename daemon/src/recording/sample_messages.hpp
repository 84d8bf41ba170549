#pragma once
/// Samples as the IDL types and back: copying, nothing else.

#include <string_view>

#include "abbe/protocol/samples.hpp"
#include "abbe_v1.h"

namespace abbe::daemon::recording {

/// Fill an existing message, so that its strings and sequences keep their memory.
void fill(v1::TrackerPoint& message, const protocol::TrackerPoint& point, std::string_view device);
void fill(v1::AxisSample& message, const protocol::AxisSample& sample, std::string_view device);
void fill(v1::EnvironmentSample& message, const protocol::EnvironmentSample& sample, std::string_view device);

[[nodiscard]] protocol::TrackerPoint sample_of(const v1::TrackerPoint& message);
[[nodiscard]] protocol::AxisSample sample_of(const v1::AxisSample& message);
[[nodiscard]] protocol::EnvironmentSample sample_of(const v1::EnvironmentSample& message);

}  // namespace abbe::daemon::recording

#pragma once
/// The rules by which this version of abbe makes and uses samples, as version entries of a
/// recording. If an entry is missing, a replay behaves like the versions of abbe without that rule.
/// All code that makes a recording of a live run adds the entries.

#include <string>
#include <utility>
#include <vector>

#include "abbe/pipeline/axis_zero.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/sensor_options.hpp"

namespace abbe::daemon {

/// Key and version of each rule, as in RecordingInfo::versions.
[[nodiscard]] inline std::vector<std::pair<std::string, std::string>> recording_rules() {
  return {{kAxisSamplesRule, "1"}, {kZeroRule, "2"}, {kRotaryTravelRule, "1"}, {kSensorRule, "1"}};
}

}  // namespace abbe::daemon

#pragma once
/// The conditions in the answer of abbed to "status", with their texts: for MTConnect and for
/// notifications. Pure, thread-safe; allocates. The functions throw
/// nlohmann::json::exception if a member is missing or has another type, because the status is that
/// of another version of abbed.

#include <map>
#include <nlohmann/json.hpp>
#include <string>

namespace abbe::daemon {

enum class Level { Warning, Fault };

struct Raised {
  Level level = Level::Warning;
  std::string text;
  friend bool operator==(const Raised&, const Raised&) = default;
};

/// What is raised, by native code. Empty: NORMAL.
using Condition = std::map<std::string, Raised>;

/// COMMUNICATIONS: one native code for each device, its stream name.
[[nodiscard]] Condition device_condition(const nlohmann::json& status);
/// SYSTEM: the parts of abbed that are not devices, and a machine that waits for its release.
[[nodiscard]] Condition system_condition(const nlohmann::json& status);
/// DATA_RANGE: the active model and the verdict of the last calibration.
[[nodiscard]] Condition model_condition(const nlohmann::json& status);

}  // namespace abbe::daemon

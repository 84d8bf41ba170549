#pragma once
/// The conditions in the answer of abbed to "status", with their texts: for MTConnect and for
/// notifications. Pure, thread-safe; allocates. The functions throw nlohmann::json::exception if a
/// member is missing or has another type. This happens if the status comes from another version of
/// abbed.

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

/// The raised conditions, by native code (the text that identifies a condition in MTConnect).
/// Empty: NORMAL.
using Condition = std::map<std::string, Raised>;

/// Condition COMMUNICATIONS: one native code for each device, the name of its stream.
[[nodiscard]] Condition device_condition(const nlohmann::json& status);
/// Condition SYSTEM: the parts of abbed that are not devices, and a machine that waits for its
/// release.
[[nodiscard]] Condition system_condition(const nlohmann::json& status);
/// Condition DATA_RANGE: the active model and the verdict of the last calibration.
[[nodiscard]] Condition model_condition(const nlohmann::json& status);

}  // namespace abbe::daemon

#pragma once
/// Words for a calibration, the same in all commands that show it.

#include <nlohmann/json.hpp>
#include <string>

namespace abbe::daemon {

/// "about 6.3 min left", "about 45 s left". `session`: that of a status reply. Empty if the reply
/// has no remaining time: it is not known yet, or the daemon is an older version.
[[nodiscard]] std::string remaining_time(const nlohmann::json& session);

/// The state for people: "start" for "warming", which the messages call the time before a run.
[[nodiscard]] std::string state_in_words(const nlohmann::json& session);

}  // namespace abbe::daemon

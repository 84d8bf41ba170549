#pragma once
/// Words for a calibration, the same in all commands that show it.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace abbe::daemon {

/// "about 6.3 min left", "about 45 s left". `session`: that of a status reply. Empty if the reply
/// has no remaining time: it is not known yet, or the daemon is an older version.
[[nodiscard]] std::string remaining_time(const nlohmann::json& session);

/// The state for people: "before the start" for "warming", "has ended: accepted".
[[nodiscard]] std::string state_in_words(const nlohmann::json& session);

/// Sentences about the session: the verdict with reasons and notes, or the reason of its state, or
/// what the operator must do; and the command that identifies the run again. Older versions of
/// abbed send no verdict.
[[nodiscard]] std::vector<std::string> sentences_of(const nlohmann::json& session);

}  // namespace abbe::daemon

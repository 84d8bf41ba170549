#pragma once
/// Times in messages for people: in the time zone of this computer, followed by UTC. Files,
/// `--json` and messages between programs contain only UTC (utc_text.hpp).

#include <string>

#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

/// The time to whole seconds: "2024-05-17 10:30:00 +0200 (2024-05-17T08:30:00Z)", or only
/// "2024-05-17T08:30:00Z" where the zone is UTC. The zone comes from TZ, else from /etc/localtime,
/// as it was when the program first used it. Any thread, as long as no thread changes the
/// environment.
[[nodiscard]] std::string local_time_text(protocol::UtcTime time);

}  // namespace abbe::daemon

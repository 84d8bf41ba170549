#pragma once
/// Times for people: in the time zone of this computer, with UTC beside it. Files, `--json` and
/// messages between programs have UTC alone (utc_text.hpp).

#include <string>

#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

/// To whole seconds: "2024-05-17 10:30:00 +0200 (2024-05-17T08:30:00Z)"; where the zone is UTC:
/// "2024-05-17T08:30:00Z". The zone is that of TZ, else of /etc/localtime, as read when the program
/// first used it. Any thread, as long as no thread changes the environment.
[[nodiscard]] std::string local_time_text(protocol::UtcTime time);

}  // namespace abbe::daemon

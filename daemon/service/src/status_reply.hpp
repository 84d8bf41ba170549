#pragma once
/// The answer to {"do": "status"}.

#include "on_hub.hpp"

namespace abbe::daemon {

/// Copies what the answer needs; the hub's thread. Positions older than half a second of wall time,
/// and those of axes that are missing, are null.
[[nodiscard]] Reply status_reply(const Hub& hub);

}  // namespace abbe::daemon

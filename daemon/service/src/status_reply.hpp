#pragma once
/// The answers to {"do": "status"} and {"do": "live"}.

#include "on_hub.hpp"

namespace abbe::daemon {

/// Copies the data for the answer to "status". Call it on the hub's thread. Positions older than
/// half a second of wall time, and those of missing axes, are null in the answer.
[[nodiscard]] Reply status_reply(const Hub& hub);
/// The answer with the positions alone, for displays that ask often.
[[nodiscard]] Reply live_reply(const Hub& hub);

}  // namespace abbe::daemon

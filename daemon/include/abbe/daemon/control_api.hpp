#pragma once
/// What a person or program may ask a running daemon, request by request:
///     {"do": "status"}
///     {"do": "calibrate", "method": "otf", "path_m": [[x, y, z], ...], "who": REMARK}
///     {"do": "cancel", "who": REMARK}
///     {"do": "touch", "where": true}
///     {"do": "touch", "points": [{"way": [[x, y, z], ...], "at_m": [x, y, z], "normal": [i, j, k]}, ...],
///      "leave": [[x, y, z], ...]}
///     {"do": "touch", "cancel": true}
///     {"do": "touches"}: at least every 2 s, else the touching ends
/// Who asked is "user", which the server sets; "who", if it says something else, is kept beside it.
/// Lengths m. Models are activated and rolled back in the store; the daemon follows it. Runs on the hub's
/// thread, through Hub::call().

#include <chrono>
#include <nlohmann/json.hpp>

#include "abbe/daemon/hub.hpp"

namespace abbe::daemon {

/// The answer to one request, from any thread but the hub's; a hub that does not answer in `time_out` is said
/// so.
[[nodiscard]] nlohmann::json answer_request(Hub& hub, const nlohmann::json& request,
                                            std::chrono::milliseconds time_out = std::chrono::seconds{3});

}  // namespace abbe::daemon

#pragma once
/// What a person or program may ask a running daemon, request by request:
///     {"do": "status"}
///     {"do": "calibrate", "method": "otf", "path_m": [[x, y, z], ...], "who": REMARK}: gives "session", its
///     number; "status" has it as "id" of "session" and of the "ended_sessions"
///     {"do": "cancel", "who": REMARK}
///     {"do": "touch", "where": true}
///     {"do": "touch", "points": [{"way": [[x, y, z], ...], "at_m": [x, y, z], "normal": [i, j, k]}, ...],
///      "leave": [[x, y, z], ...]}
///     {"do": "touch", "cancel": true}
///     {"do": "touches"}: at least every 2 s, else the touching is stopped
///     {"do": "machine"}; with "stop": true, "release": true
///     {"do": "tracker", "order": "initialize" | "home"}
///     {"do": "tracker", "order": "find", "distance_m": 2.5}
///     {"do": "tracker", "order": "reflector set", "reflector": NAME or ID}
///     {"do": "tracker_reflectors"}: these four give "order", its number; "status" has it among the "orders"
///     of "tracker", with "outcome" "running", "done", "refused" or "failed" and its "text"
/// Who asked is "user", which the server sets; the first 64 bytes of "who", if it says something else, are
/// kept beside it. Lengths m. Models are activated and rolled back in the store; the daemon follows it. A
/// request is read and its answer written on the asking thread; in between Hub::call() runs what has to run
/// on the hub's thread, which does not grow with the request.

#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abbe/base/control_protocol.hpp"
#include "abbe/service/control_roles.hpp"
#include "abbe/service/hub.hpp"

namespace abbe::daemon {

/// {"do": name}, or {"do": name, member: true}, and the role it takes.
struct ControlVerb {
  std::string name;
  std::string member;
  Role role;
};
[[nodiscard]] std::vector<ControlVerb> control_verbs();

/// The answer to one request of `peer`, which is refused without the role the request takes; from
/// any thread but the hub's; a hub that does not answer in `time_out` is said so.
[[nodiscard]] nlohmann::json answer_request(
    Hub& hub, const nlohmann::json& request, const ControlPeer& peer,
    std::chrono::milliseconds time_out = std::chrono::seconds{3});

/// The same, all steps in this thread, where the hub has none.
[[nodiscard]] nlohmann::json answer_on_hub(const Hub& hub, const nlohmann::json& request,
                                           const ControlPeer& peer);

}  // namespace abbe::daemon

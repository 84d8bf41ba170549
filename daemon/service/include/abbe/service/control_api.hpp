#pragma once
/// The requests of the control socket:
///
///     {"do": "status"}
///     {"do": "live"}
///     {"do": "calibration"}
///     {"do": "calibrate", "method": "otf", "path_m": [[x, y, z], ...], "who": REMARK}
///     {"do": "calibrate", "method": "evemu", "calibrator": {..}, "sources": [..], ...}
///     {"do": "calibrate", "method": "mfb", "bar": {"file": NAME, "text": TOML},
///      "plan": {"file": NAME, "text": TOML}, "earlier_m": [[x, y, z], ...]}
///     {"do": "cancel", "who": REMARK}
///     {"do": "activate", "id": ID, "why": TEXT, "force": false, "who": REMARK}
///     {"do": "add", "model": TEXT, "why": TEXT, "who": REMARK}
///     {"do": "rollback", "active": ID, "why": TEXT, "who": REMARK}
///     {"do": "change", "number": NUMBER}
///     {"do": "touch", "where": true}
///     {"do": "touch", "points": [{"way": [[x, y, z], ...], "at_m": [x, y, z],
///                                 "normal": [i, j, k]}, ...],
///      "leave": [[x, y, z], ...]}
///     {"do": "touch", "cancel": true}
///     {"do": "touches"}
///     {"do": "machine"}; with "stop": true, "release": true
///     {"do": "tracker", "order": "initialize" | "home"}
///     {"do": "tracker", "order": "find", "distance_m": 2.5}
///     {"do": "tracker", "order": "reflector set", "reflector": NAME or ID}
///     {"do": "tracker_reflectors"}
///
/// "machine" with "stop" returns "stop", the number of the request. "machine" and "status" (as
/// "machine_stop") contain the latest request to stop: {"number", "outcome", "text"}. "touches"
/// also contains it once a cancelled job has ended. "outcome" is "pending", "stopped" (AbortE was
/// answered, or no motion was under way), "not confirmed" (refused, not answered, connection lost)
/// or "not sent" (no connection). Repeat "machine" until the outcome of that number, or of a later
/// one, is not "pending". After "not confirmed" and "not sent" the machine may still be moving;
/// AbortE is then the first command on the next connection.
///
/// "touch" is refused as a whole if a place is not finite or outside the volume, or if a normal is
/// not a unit vector.
///
/// "calibrate" returns "session", the number of the session; "status" contains it as "id" of
/// "session" and of the "ended_sessions". "touches" must be repeated at least every 2 s, else the
/// touching is stopped. "tracker" and "tracker_reflectors" return "order", the number of the order;
/// "status" contains it in the "orders" of "tracker", with "outcome" "running", "done", "refused"
/// or "failed" and its "text".
///
/// While a ball array is touched, "next" of "session" contains the "features" of the position:
/// "on", the points "touched" of "points" and, as soon as the touches determine them, "at_m"
/// (centre of a ball, or of the points on a block) and the "normal" of the face of a block, to the
/// side that the calibrator states.
///
/// The server sets "user", the user who sends the request. The first 64 bytes of "who", if it
/// differs from "user", are kept beside it. Lengths in m. "live" returns the "position_m" of
/// "status" alone; "calibration" the "request" of the present or last session. "activate", "add"
/// and "rollback" change the model store, as `abbe model` does; the daemon follows the store. They
/// return the "change" and, if it is done, the "id" of the active model, or of the one that was
/// added; until then ask with "change". "model" is the text of a model.json with the verdict of the
/// gate; it is added with this verdict and not activated. "rollback" is refused if another model
/// than "active" is active: a request that is repeated because its answer was lost does not go one
/// model further back. The calling thread reads the request and writes the answer. Hub::call() runs
/// the part that needs the hub's thread; the duration of this part does not depend on the size of
/// the request.

#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abbe/base/control_protocol.hpp"
#include "abbe/service/control_roles.hpp"
#include "abbe/service/hub.hpp"

namespace abbe::daemon {

/// A request {"do": name}, or {"do": name, member: true}, and the role it requires.
struct ControlVerb {
  std::string name;
  std::string member;
  Role role;
};
[[nodiscard]] std::vector<ControlVerb> control_verbs();

/// The answer to one request of `peer`. Refused if `peer` does not have the required role; Io if
/// the hub does not answer within `time_out`. Any thread except the hub's.
[[nodiscard]] nlohmann::json answer_request(
    Hub& hub, const nlohmann::json& request, const ControlPeer& peer,
    std::chrono::milliseconds time_out = std::chrono::seconds{3});

/// Same as answer_request(), but executes all steps on the calling thread. For a hub without its
/// own thread.
[[nodiscard]] nlohmann::json answer_on_hub(const Hub& hub, const nlohmann::json& request,
                                           const ControlPeer& peer);

}  // namespace abbe::daemon

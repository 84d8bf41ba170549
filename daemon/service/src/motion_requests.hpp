#pragma once
/// Requests that move a measuring machine, stop it or ask for its position: those of `abbe
/// calibrate artefact` and `abbe machine`. All functions run on the client's thread; the step that
/// they return runs on the hub's thread.

#include "on_hub.hpp"

namespace abbe::daemon {

/// The request {"do": "touch", "points": [...], "leave": [...]}. A plan that is too long is an
/// Error Usage.
[[nodiscard]] Result<OnHub> begin_touching(const HubParts& parts, const nlohmann::json& request);
/// The request {"do": "touch", "cancel": true}.
[[nodiscard]] Result<OnHub> cancel_touching(const HubParts& parts, const nlohmann::json& request);
/// The request {"do": "touch", "where": true}.
[[nodiscard]] Result<OnHub> where_it_stands(const HubParts& parts, const nlohmann::json& request);
/// The request {"do": "touches"}.
[[nodiscard]] Result<OnHub> look_at_touches(const HubParts& parts, const nlohmann::json& request);
/// The request {"do": "machine", "release": true}. Only a person who has inspected the machine may
/// send it.
[[nodiscard]] Result<OnHub> release_machine(const HubParts& parts, const nlohmann::json& request);
/// The request {"do": "machine", "stop": true}: stops every motion. The answer contains the number
/// of the stop.
[[nodiscard]] Result<OnHub> stop_machine(const HubParts& parts, const nlohmann::json& request);
/// The request {"do": "machine"}.
[[nodiscard]] Result<OnHub> machine_state(const HubParts& parts, const nlohmann::json& request);

/// Adds the member "stop" with number, outcome and text, if a stop was requested.
void add_stop(nlohmann::json& answer, const drivers::IppStop& stop);

}  // namespace abbe::daemon

#pragma once
/// The requests about the tracker on the control socket, which `abbe tracker` sends.

#include <cstdint>
#include <deque>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "abbe/service/hub.hpp"

namespace abbe::daemon {

/// State of the tracker, copied on the hub's thread.
struct SeenTracker {
  drivers::DeviceStatus status;
  std::deque<TrackerService::Order> orders;
};
/// State of the tracker; nullopt without a tracker. To be called on the hub's thread.
[[nodiscard]] std::optional<SeenTracker> look_at_tracker(const HubParts& parts);
/// Member "tracker" of "status": state, cause and the latest orders. Any thread.
[[nodiscard]] nlohmann::json tracker_json(const SeenTracker& seen);

/// The order in {"do": "tracker", "order": WORD, ...}. Any thread.
[[nodiscard]] Result<drivers::TrackerOrder> tracker_order_from_json(const nlohmann::json& request);
/// Starts the order for the user `by` and returns the number of the order. To be called on the
/// hub's thread.
[[nodiscard]] Result<std::uint64_t> order_tracker(const HubParts& parts,
                                                  const drivers::TrackerOrder& order,
                                                  const std::string& by);

}  // namespace abbe::daemon

#pragma once
/// Derives the values that an MTConnect agent shows of abbe from the answer of abbed to "status".
/// The names of the data items are those of daemon/examples/mtconnect-devices.xml. Pure,
/// thread-safe; allocates.

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <variant>

#include "abbe/base/status_conditions.hpp"

namespace abbe::mtconnect {

struct Message {
  std::string code, text;
  friend bool operator==(const Message&, const Message&) = default;
};

using daemon::Condition;
using daemon::Level;
using daemon::Raised;

/// The value of a data item: an event, a message or a condition. nullopt: UNAVAILABLE, because
/// abbed does not answer or has no such value.
using Value =
    std::variant<std::optional<std::string>, std::optional<Message>, std::optional<Condition>>;

/// Values by the name of the data item. Always contains all data items.
using Observations = std::map<std::string, Value>;

/// `status`: the answer to {"do": "status"}. Throws if the status comes from another version of
/// abbed: nlohmann::json::exception if a member is missing or has another type, std::out_of_range
/// for an unknown state of a calibration.
[[nodiscard]] Observations observations_of(const nlohmann::json& status);

/// Values while abbed does not answer: everything is UNAVAILABLE.
[[nodiscard]] Observations nothing_observed();

}  // namespace abbe::mtconnect

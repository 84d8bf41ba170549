#pragma once
/// What an MTConnect agent shows of abbe, derived from the answer of abbed to "status". The names
/// of the data items are those of daemon/examples/mtconnect-devices.xml. Pure, thread-safe;
/// allocates.

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

/// An event, a message or a condition. nullopt: UNAVAILABLE, because abbed is away or has no such
/// value.
using Value =
    std::variant<std::optional<std::string>, std::optional<Message>, std::optional<Condition>>;

/// By name of the data item. Always all data items.
using Observations = std::map<std::string, Value>;

/// `status`: the answer to {"do": "status"}. Throws, if it is that of another version of abbed:
/// nlohmann::json::exception if a member is missing or has another type, std::out_of_range for an
/// unknown state of a calibration.
[[nodiscard]] Observations observations_of(const nlohmann::json& status);

/// abbed is away: everything is UNAVAILABLE.
[[nodiscard]] Observations nothing_observed();

}  // namespace abbe::mtconnect

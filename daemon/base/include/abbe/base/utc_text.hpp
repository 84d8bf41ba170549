#pragma once
/// Instants as people and files write them: RFC 3339 in UTC, "2024-05-17T08:30:00.123456789Z".

#include <optional>
#include <string>
#include <string_view>

#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

[[nodiscard]] std::string to_text(protocol::UtcTime time);
/// Nothing for any other form, and for years before 1678 or after 2261, which UtcTime does not
/// hold.
[[nodiscard]] std::optional<protocol::UtcTime> utc_from_text(std::string_view text);

}  // namespace abbe::daemon

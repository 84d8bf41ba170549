#pragma once
/// UTC times as text, in files and messages: RFC 3339, "2024-05-17T08:30:00.123456789Z".

#include <optional>
#include <string>
#include <string_view>

#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

[[nodiscard]] std::string to_text(protocol::UtcTime time);
/// The time in an RFC 3339 text. nullopt for any other format, and for years before 1678 or after
/// 2261, which UtcTime cannot represent.
[[nodiscard]] std::optional<protocol::UtcTime> utc_from_text(std::string_view text);

}  // namespace abbe::daemon

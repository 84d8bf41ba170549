#pragma once
/// Texts of SHDR, the line format between an MTConnect adapter and an agent: fields separated by
/// "|", the first one a time [cppagent, "SHDR 2.0"]. Pure, thread-safe; allocates.

#include <cstddef>
#include <string>
#include <string_view>

#include "abbe/protocol/time.hpp"

namespace abbe::mtconnect {

/// Longest text of a field in bytes, before it is quoted. Longer ones are cut between two
/// characters.
inline constexpr std::size_t kLongestText = 1000;

/// `text` as one field.
/// - A line break or another control character becomes a space: SHDR cannot escape a line break,
///   and XML, which the agent writes, cannot contain the others. A byte that is not UTF-8 becomes
///   "?".
/// - A text with "|", or with a quotation mark at its beginning, is enclosed in quotation marks,
///   with a backslash before "|", quotation marks and backslashes.
/// - A text with "--multiline--" is enclosed as well, and gets a backslash after its first
///   character. Otherwise the agent would wait for a document in several lines and show nothing
///   that follows.
[[nodiscard]] std::string shdr_field(std::string_view text);

/// Makes a native code. ":" becomes "_", because the agent would use the part after ":" as the
/// condition's id.
[[nodiscard]] std::string shdr_code(std::string_view code);

/// UTC with microseconds, the resolution of an agent: "2024-05-17T08:30:00.123456Z".
[[nodiscard]] std::string shdr_time(protocol::UtcTime time);

}  // namespace abbe::mtconnect

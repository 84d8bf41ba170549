#pragma once
/// Dates with a time of day in the text files of other programs.

#include <optional>
#include <string_view>

namespace abbe::daemon {

/// "2022-12-02 09:35:54.535389" or "05/28/19 18:01:15" (month first; year of two or four digits),
/// with or without decimals of the second, as seconds since 1970 of the same clock and time zone.
/// nullopt for any other text.
[[nodiscard]] std::optional<double> seconds_of_stamp(std::string_view text);

}  // namespace abbe::daemon

#pragma once
/// Error values that a spreadsheet writes into cells, among the lines of a CSV file that begin with
/// #.

#include <algorithm>
#include <array>
#include <string_view>

namespace abbe::protocol {

/// True for the text of an error value: #N/A and its translations; # followed by capital letters
/// and a final "!" or "?" (#REF!, #DIV/0!, #VALUE!, #NAME?, #WERT!); or several # and nothing else
/// (a column that is too narrow for its number).
[[nodiscard]] inline bool is_spreadsheet_error(std::string_view cell) {
  constexpr std::array<std::string_view, 6> kNotAvailable{"#N/A", "#NV", "#N/D",
                                                          "#N/V", "#NA", "#N/B"};
  if (!cell.starts_with('#') || cell.size() < 2) return false;
  if (std::ranges::find(kNotAvailable, cell) != kNotAvailable.end()) return true;
  if (cell.find_first_not_of('#') == std::string_view::npos) return true;
  const auto no_name = [](char c) { return c == ' ' || c == '#' || (c >= 'a' && c <= 'z'); };
  return (cell.ends_with('!') || cell.ends_with('?')) &&
         std::none_of(cell.begin() + 1, cell.end(), no_name);
}

/// True if the first cell of the line is an error value. #### alone in a line is a comment.
[[nodiscard]] inline bool begins_with_spreadsheet_error(std::string_view line) {
  const auto end = line.find_first_of(",;\t");
  auto cell = line.substr(0, end);
  while (cell.ends_with(' ')) cell.remove_suffix(1);
  const bool rule = cell.find_first_not_of('#') == std::string_view::npos;
  return is_spreadsheet_error(cell) && (end != std::string_view::npos || !rule);
}

}  // namespace abbe::protocol

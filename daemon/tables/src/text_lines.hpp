#pragma once
/// Lines, fields and numbers of the text files of other programs.

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/faults.hpp"
#include "abbe/protocol/decimal.hpp"
#include "abbe/protocol/printable.hpp"

namespace abbe::daemon {

[[nodiscard]] inline std::string_view without_blanks(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\n";
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

[[nodiscard]] inline std::string in_lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

/// Iterates over the lines that are not empty. CR before a newline and a byte order mark are
/// skipped.
class TextLines {
 public:
  explicit TextLines(std::string_view text) : text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);
  }

  /// False at the end of the text.
  bool next() {
    while (!text_.empty()) {
      whole_ = text_.substr(0, text_.find('\n'));
      text_.remove_prefix(std::min(text_.size(), whole_.size() + 1));
      ++number_;
      line_ = without_blanks(whole_);
      if (!line_.empty()) return true;
    }
    return false;
  }
  [[nodiscard]] std::string_view line() const noexcept { return line_; }  ///< without blanks
  [[nodiscard]] std::size_t number() const noexcept { return number_; }
  /// Of `part`, which is a part of line().
  [[nodiscard]] std::size_t column(std::string_view part) const {
    return part.empty() ? 1 : 1 + static_cast<std::size_t>(part.data() - whole_.data());
  }

 private:
  std::string_view text_, whole_, line_;
  std::size_t number_ = 0;
};

/// The fields of a line, without blanks at their ends. Separator blank: any number of blanks and
/// tabs.
[[nodiscard]] inline std::vector<std::string_view> fields_of(std::string_view line,
                                                             char separator = ' ') {
  std::vector<std::string_view> fields;
  const std::string_view signs =
      separator == ' ' ? std::string_view(" \t") : std::string_view(&separator, 1);
  for (std::size_t at = 0; at <= line.size();) {
    const std::size_t end = std::min(line.find_first_of(signs, at), line.size());
    const auto field = without_blanks(line.substr(at, end - at));
    if (separator != ' ' || !field.empty()) fields.push_back(field);
    at = end + 1;
  }
  return fields;
}

/// Adds a fault and returns true if the file is empty or no text of single bytes or UTF-8.
[[nodiscard]] inline bool is_no_text(std::string_view text, Faults& faults) {
  const auto add = [&faults](std::string_view what) {
    faults.add(1, 1, "", what);
    return true;
  };
  if (without_blanks(text).empty()) return add("the file is empty");
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF"))
    return add("the file is UTF-16: save it as UTF-8");
  if (text.find('\0') != std::string_view::npos) return add("not a text file: export text (ASCII)");
  return false;
}

inline void check_last_newline(std::string_view text, std::size_t line, Faults& faults) {
  if (!text.ends_with('\n'))
    faults.add(line, 1, "",
               "the last line does not end with a newline: the file may be cut off (if it is "
               "complete, add a newline)");
}

[[nodiscard]] inline bool is_number_field(std::string_view field) {
  double value = 0.0;
  return protocol::parse_decimal(field, value).empty();
}

/// What is wrong with a field that must be a number; sets `value` if nothing is.
[[nodiscard]] inline std::string number_fault(std::string_view field, double& value) {
  const auto fault = protocol::parse_decimal(field, value);
  if (fault.empty()) return {};
  std::string pointed(field);
  std::ranges::replace(pointed, ',', '.');
  const bool comma = pointed != field && is_number_field(pointed);
  return fmt::format("\"{}\": {}{}", protocol::printable_line(field), fault,
                     comma ? ", has a decimal comma: write 0.5, not 0,5 (export with a language "
                             "that has decimal points)"
                           : "");
}

}  // namespace abbe::daemon

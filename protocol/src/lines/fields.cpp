#include "abbe/protocol/lines/fields.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <system_error>

namespace abbe::protocol::lines {
namespace {

constexpr std::size_t kLongestNumber = 40;

bool is_blank(char c) noexcept {
  return c == ' ' || c == '\t';
}

bool separates(char c, char separator) noexcept {
  return separator == ' ' ? is_blank(c) : c == separator;
}

/// Without blanks at both ends, except tabs that separate: each of them ends a column.
std::string_view trimmed(std::string_view text, char separator) noexcept {
  const auto is_around = [separator](char c) {
    return is_blank(c) && (separator == ' ' || c != separator);
  };
  while (!text.empty() && is_around(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_around(text.back())) text.remove_suffix(1);
  return text;
}

}  // namespace

Fields::Fields(std::string_view line, char separator) ABBE_RT : rest_(trimmed(line, separator)),
                                                                separator_(separator) {}

std::optional<std::string_view> Fields::next() ABBE_RT {
  if (rest_.empty()) return std::nullopt;
  std::size_t end = 0;
  while (end < rest_.size() && !separates(rest_[end], separator_)) ++end;
  const std::string_view field = trimmed(rest_.substr(0, end), separator_);
  rest_.remove_prefix(end);
  if (!rest_.empty()) rest_.remove_prefix(1);  // the separator
  rest_ = trimmed(rest_, separator_);
  return field;
}

std::optional<double> number(std::string_view text, char decimal_sign) ABBE_RT {
  std::array<char, kLongestNumber> copy;  // NOLINT: filled below
  if (!text.empty() && text.front() == '+') {
    text.remove_prefix(1);
    if (!text.empty() && text.front() == '-') return std::nullopt;
  }
  if (text.empty() || text.size() > copy.size()) return std::nullopt;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '.' && decimal_sign != '.') return std::nullopt;  // a thousands separator
    copy[i] = c == decimal_sign ? '.' : c;
  }
  double value = 0.0;
  const char* const end = copy.data() + text.size();
  const auto read = std::from_chars(copy.data(), end, value);
  if (read.ec != std::errc{} || read.ptr != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace abbe::protocol::lines

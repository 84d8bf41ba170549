#include "abbe/protocol/lines/line_format.hpp"

#include <algorithm>
#include <charconv>
#include <limits>
#include <system_error>

#include "decode_columns.hpp"

namespace abbe::protocol::lines {
namespace {

using What = LineFault::What;

bool is_digit(char c) noexcept {
  return c >= '0' && c <= '9';
}

int digits_of(TimeUnit unit) noexcept {
  switch (unit) {
    case TimeUnit::Seconds:
      return 9;
    case TimeUnit::Milliseconds:
      return 6;
    case TimeUnit::Microseconds:
      return 3;
    case TimeUnit::Nanoseconds:
      break;
  }
  return 0;
}

/// Adds a decimal digit; false: the result does not fit.
bool append_digit(std::int64_t& value, int digit) noexcept {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max() / 2;
  if (value > (kMost - digit) / 10) return false;
  value = 10 * value + digit;
  return true;
}

std::int32_t status_number(std::string_view text) noexcept {
  std::int32_t value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = read.ec == std::errc{} && read.ptr == text.data() + text.size();
  return whole ? value : 0;
}

}  // namespace

/// Reads the digits, without a detour over double: since 1970 there are 1.8e18 ns, of which a
/// double resolves 256 ns.
tl::expected<DeviceTime, What> decode_time(std::string_view text,
                                           const LineSyntax& syntax) ABBE_RT {
  const bool negative = !text.empty() && text.front() == '-';
  if (!text.empty() && (text.front() == '-' || text.front() == '+')) text.remove_prefix(1);
  const int places = digits_of(syntax.time_unit);
  std::int64_t ns = 0;
  std::size_t digits = 0;
  int fraction = -1;  // digits after the decimal sign; -1: none was read yet

  for (const char c : text) {
    if (c == syntax.decimal_sign && fraction < 0) {
      fraction = 0;
      continue;
    }
    if (!is_digit(c)) return tl::unexpected{What::NotANumber};
    ++digits;
    if (fraction >= 0 && ++fraction > places) continue;  // below a nanosecond
    if (!append_digit(ns, c - '0')) return tl::unexpected{What::OutOfRange};
  }

  if (digits == 0) return tl::unexpected{What::NotANumber};
  for (int i = std::max(fraction, 0); i < places; ++i)
    if (!append_digit(ns, 0)) return tl::unexpected{What::OutOfRange};

  return DeviceTime{std::chrono::nanoseconds{negative ? -ns : ns}};
}

bool is_one_of(std::span<const StatusWord> words, std::string_view text) ABBE_RT {
  return std::any_of(words.begin(), words.end(),
                     [text](const StatusWord& word) { return word.text() == text; });
}

void decode_status(std::string_view text, const LineSyntax& syntax, LineMarks& marks) ABBE_RT {
  marks.status = status_number(text);
  marks.valid = is_one_of(std::span{syntax.valid_status}.first(syntax.valid_status_count), text);
}

std::optional<StatusWord> StatusWord::from(std::string_view text) ABBE_RT {
  if (text.empty() || text.size() > kCapacity) return std::nullopt;
  StatusWord word;
  std::copy(text.begin(), text.end(), word.bytes.begin());
  word.length = static_cast<std::uint8_t>(text.size());
  return word;
}

bool is_comment(std::string_view line) ABBE_RT {
  const auto begin = line.find_first_not_of(" \t");
  return begin == std::string_view::npos || line[begin] == '#';
}

bool is_heading(std::string_view line) ABBE_RT {
  return std::none_of(line.begin(), line.end(), is_digit);
}

std::string_view text_of(What what) ABBE_RT {
  switch (what) {
    case What::MissingColumn:
      return "missing";
    case What::TooManyColumns:
      return "more columns than configured";
    case What::NotANumber:
      return "not a number";
    case What::OutOfRange:
      return "impossible in the configured unit";
    case What::TooLong:
      return "longer than 512 bytes";
  }
  return "?";
}

}  // namespace abbe::protocol::lines

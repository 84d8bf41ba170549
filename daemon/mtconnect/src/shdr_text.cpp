#include "abbe/mtconnect/shdr_text.hpp"

#include <algorithm>
#include <cstdint>

#include "abbe/base/utc_text.hpp"

namespace abbe::mtconnect {
namespace {

/// Number of bytes of the UTF-8 character at the beginning of `text`; 0: it is malformed [RFC 3629,
/// 4].
std::size_t utf8_length(std::string_view text) {
  const auto byte = [text](std::size_t i) {
    return i < text.size() ? static_cast<std::uint8_t>(text[i]) : std::uint8_t{0};
  };
  const auto continues = [&byte](std::size_t i) { return (byte(i) & 0xC0) == 0x80; };

  const std::uint8_t first = byte(0);
  if (first < 0x80) return 1;
  if (first >= 0xC2 && first <= 0xDF) return continues(1) ? 2 : 0;
  if (first >= 0xE0 && first <= 0xEF) {
    const bool overlong = first == 0xE0 && byte(1) < 0xA0;
    const bool surrogate = first == 0xED && byte(1) > 0x9F;
    return continues(1) && continues(2) && !overlong && !surrogate ? 3 : 0;
  }
  if (first < 0xF0 || first > 0xF4) return 0;
  const bool overlong = first == 0xF0 && byte(1) < 0x90;
  const bool beyond = first == 0xF4 && byte(1) > 0x8F;
  return continues(1) && continues(2) && continues(3) && !overlong && !beyond ? 4 : 0;
}

// If a line contains this word, an agent keeps this line and all following lines until the text
// that begins here is repeated: a document in several lines [cppagent, README, "Assets"].
constexpr std::string_view kMultiline = "--multiline--";

bool is_control(char c) {
  return static_cast<std::uint8_t>(c) < 0x20 || c == 0x7F;
}

/// The text without control characters, truncated to at most kLongestText bytes of UTF-8.
std::string printable(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    if (out.size() + std::max<std::size_t>(length, 1) > kLongestText) break;
    if (length == 0) {
      out += '?';
    } else if (is_control(text.front())) {
      out += ' ';
    } else {
      out += text.substr(0, length);
    }
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return out;
}

/// The text without spaces at both ends, which the agent would remove. The first remaining
/// character decides whether a field is quoted.
std::string without_outer_spaces(const std::string& text) {
  const auto first = text.find_first_not_of(' ');
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(' ') - first + 1);
}

}  // namespace

std::string shdr_field(std::string_view text) {
  const std::string plain = without_outer_spaces(printable(text));
  const std::string_view view = plain;
  if (view.find('|') == view.npos && view.find(kMultiline) == view.npos && !view.starts_with('"'))
    return plain;

  std::string quoted = "\"";
  for (std::size_t i = 0; i < view.size(); ++i) {
    const bool second_of_multiline = i > 0 && view.substr(i - 1).starts_with(kMultiline);
    if (view[i] == '|' || view[i] == '"' || view[i] == '\\' || second_of_multiline) quoted += '\\';
    quoted += view[i];
  }
  return quoted + '"';
}

std::string shdr_code(std::string_view code) {
  std::string out{code};
  std::ranges::replace(out, ':', '_');
  return shdr_field(out);
}

std::string shdr_time(protocol::UtcTime time) {
  // number of digits of "...123456789Z" after the microseconds
  constexpr std::size_t kNanosecondDigits = 3;
  std::string text = daemon::to_text(time);
  text.erase(text.size() - 1 - kNanosecondDigits, kNanosecondDigits);
  return text;
}

}  // namespace abbe::mtconnect

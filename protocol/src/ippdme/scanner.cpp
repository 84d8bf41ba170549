#include "ippdme/scanner.hpp"

#include <algorithm>
#include <charconv>

namespace abbe::protocol::ippdme {
namespace {

constexpr std::size_t kTagLength = 5;
constexpr std::size_t kMostDigits = 16;
constexpr std::size_t kMostExponentDigits = 3;

bool is_digit(char c) noexcept {
  return c >= '0' && c <= '9';
}
bool is_letter(char c) noexcept {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z');
}

std::size_t digits_at(std::string_view text, std::size_t from) noexcept {
  std::size_t n = 0;
  while (from + n < text.size() && is_digit(text[from + n])) ++n;
  return n;
}

/// Length of the number at the front according to the grammar; nullopt if there is none.
std::optional<std::size_t> number_length(std::string_view text) noexcept {
  std::size_t at = !text.empty() && (text[0] == '+' || text[0] == '-') ? 1 : 0;
  const std::size_t whole = digits_at(text, at);
  at += whole;
  std::size_t fraction = 0;

  if (at < text.size() && text[at] == '.') {
    fraction = digits_at(text, at + 1);
    if (fraction == 0) return std::nullopt;
    at += 1 + fraction;
  }

  if (whole + fraction == 0 || whole + fraction > kMostDigits) return std::nullopt;
  if (at < text.size() && (text[at] == 'e' || text[at] == 'E')) {
    ++at;
    if (at < text.size() && (text[at] == '+' || text[at] == '-')) ++at;
    const std::size_t exponent = digits_at(text, at);
    if (exponent == 0 || exponent > kMostExponentDigits) return std::nullopt;
    at += exponent;
  }

  return at;
}

}  // namespace

bool Scanner::take(char c) ABBE_RT {
  if (peek() != c || rest_.empty()) return false;
  rest_.remove_prefix(1);
  return true;
}

void Scanner::spaces() ABBE_RT {
  while (take(' ')) {
  }
}

bool Scanner::separator(char c) ABBE_RT {
  const std::string_view before = rest_;
  spaces();
  if (take(c)) {
    spaces();
    return true;
  }
  rest_ = before;
  return false;
}

std::optional<Tag> Scanner::tag() ABBE_RT {
  if (rest_.size() < kTagLength) return std::nullopt;
  Tag tag{.event = rest_[0] == 'E'};
  for (std::size_t i = tag.event ? 1 : 0; i < kTagLength; ++i) {
    if (!is_digit(rest_[i])) return std::nullopt;
    tag.number = 10 * tag.number + static_cast<std::uint32_t>(rest_[i] - '0');
  }
  if (!tag.event && tag.number == 0) return std::nullopt;
  rest_.remove_prefix(kTagLength);
  return tag;
}

std::string_view Scanner::name() ABBE_RT {
  std::size_t n = 0;
  bool begins = true;  // a part begins with a letter
  for (; n < rest_.size(); ++n) {
    const char c = rest_[n];
    if (begins ? !is_letter(c) : !(is_letter(c) || is_digit(c) || c == '_' || c == '.')) break;
    begins = c == '.';
  }
  if (begins) return {};  // no name, or a dot at the end
  const std::string_view name{rest_.data(), n};
  rest_.remove_prefix(n);
  return name;
}

tl::expected<double, LineError> Scanner::number() ABBE_RT {
  const auto length = number_length(rest_);
  if (!length) return tl::unexpected(LineError::BadNumber);
  const std::size_t sign = rest_[0] == '+' ? 1 : 0;  // from_chars does not accept '+'
  double value = 0.0;
  const char* const end = rest_.data() + *length;
  const auto read = std::from_chars(rest_.data() + sign, end, value);
  // read.ec is also set if the exponent is too large for a double.
  if (read.ec != std::errc{} || read.ptr != end) return tl::unexpected(LineError::BadNumber);
  rest_.remove_prefix(*length);
  return value;
}

std::optional<std::string_view> Scanner::string() ABBE_RT {
  if (peek() != '"') return std::nullopt;
  const std::size_t end = rest_.find('"', 1);
  if (end == std::string_view::npos) return std::nullopt;
  const std::string_view text{rest_.data() + 1, end - 1};
  rest_.remove_prefix(end + 1);
  return text;
}

}  // namespace abbe::protocol::ippdme

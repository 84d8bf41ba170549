#include "decimal.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cstdlib>
#include <string_view>

namespace abbe::daemon {

namespace {

/// Moves the decimal point of a number like "d.ddde-05" to the right by `shift` digits. Very small
/// and very large results get an exponent, all others are written without one.
std::string move_point(const std::string& scientific, int shift) {
  const auto e = scientific.find('e');
  const bool negative = scientific.front() == '-';
  std::string digits;
  for (const char c : std::string_view{scientific}.substr(0, e))
    if (c >= '0' && c <= '9') digits += c;
  const int exponent = std::atoi(scientific.c_str() + e + 1) + shift;
  while (digits.size() > 1 && digits.back() == '0') digits.pop_back();
  const auto count = static_cast<int>(digits.size());
  std::string text = negative ? "-" : "";

  if (exponent < -5 || exponent > 16) {
    text += digits.front();
    if (count > 1) text.append(1, '.').append(digits, 1);
    text += fmt::format("e{}", exponent);
  } else if (exponent < 0) {
    text.append("0.").append(static_cast<std::size_t>(-exponent - 1), '0').append(digits);
  } else if (count <= exponent + 1) {
    text.append(digits).append(static_cast<std::size_t>(exponent + 1 - count), '0');
  } else {
    const auto whole = static_cast<std::size_t>(exponent) + 1;
    text.append(digits, 0, whole).append(1, '.').append(digits, whole);
  }

  return text;
}

}  // namespace

std::string to_decimal(double value, int shift) {
  if (value == 0.0) return "0";
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value,
                                 std::chars_format::scientific)
                       .ptr;
  auto shortest = move_point(std::string(buffer.data(), end), shift);
  if (from_decimal(std::strtold(shortest.c_str(), nullptr), shift) == value) return shortest;
  return move_point(fmt::format("{:.16e}", value), shift);  // 17 digits always determine a double
}

double from_decimal(long double written, int shift) {
  switch (shift) {
    case 3:
      return static_cast<double>(written / 1e3L);
    case 6:
      return static_cast<double>(written / 1e6L);
    case 12:
      return static_cast<double>(written / 1e12L);
    default:
      return static_cast<double>(written);
  }
}

}  // namespace abbe::daemon

#include "abbe/protocol/decimal.hpp"

#include <charconv>
#include <cmath>
#include <system_error>

#include "abbe/protocol/printable.hpp"

namespace abbe::protocol {
namespace {

bool is_decimal_digit(char c) {
  return c >= '0' && c <= '9';
}

std::string_view without_sign(std::string_view text) {
  if (text.starts_with('+') || text.starts_with('-')) text.remove_prefix(1);
  return text;
}

std::string quoted_with_reason(std::string_view text, std::string_view reason) {
  std::string result = '"' + printable_line(text) + "\": " + std::string(reason);
  if (const auto strange = strange_character(text); !strange.empty())
    result += ", contains " + strange;
  return result;
}

}  // namespace

std::string_view parse_decimal(std::string_view text, double& value) {
  if (text.empty()) return "empty";
  if (text.front() == '+') {  // spreadsheets write a leading '+'; from_chars does not accept it
    text.remove_prefix(1);
    if (text.starts_with('-')) return "not a number";
  }
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault == std::errc::result_out_of_range) return "out of range";
  if (fault != std::errc{} || end != text.data() + text.size()) return "not a number";
  if (!std::isfinite(value)) return "must be finite";
  return {};
}

std::string decimal_fault(std::string_view text, DecimalKind kind) {
  if (text.empty()) return "empty, needs a number";
  double value = 0.0;
  if (const auto fault = parse_decimal(text, value); !fault.empty())
    return quoted_with_reason(text, fault == "not a number" ? "not a decimal number" : fault);

  const auto digits = without_sign(text);
  if (digits.size() > 1 && digits[0] == '0' && is_decimal_digit(digits[1]))
    return quoted_with_reason(text, "write the number without leading zeros");
  if (kind == DecimalKind::Any) return {};
  if (digits.find_first_not_of("0123456789") != std::string_view::npos)
    return quoted_with_reason(text, "must be a whole number");
  if (kind == DecimalKind::WholeNotNegative && text.front() == '-')
    return quoted_with_reason(text, "must not be negative");
  return {};
}

}  // namespace abbe::protocol

#pragma once
/// Decimal numbers in text that a person or a program wrote. Pure; thread-safe.

#include <string>
#include <string_view>

namespace abbe::protocol {

/// Reads all of `text` as a decimal number with a decimal point, such as -1.5e-3 or +2. Sets
/// `value`. Returns what is wrong with the text ("not a number"); empty if it is valid.
[[nodiscard]] std::string_view parse_decimal(std::string_view text, double& value);

enum class DecimalKind { Any, Whole, WholeNotNegative };

/// What is wrong with `text` as the number of a command line option; empty if it is valid. Refuses
/// what has another meaning elsewhere: 010 is 8 in C and 10 in a table, 0x10 is 16 in C.
[[nodiscard]] std::string decimal_fault(std::string_view text, DecimalKind kind);

}  // namespace abbe::protocol

#pragma once
/// Reads decimal numbers in text from a person or a program. Pure; thread-safe.

#include <string>
#include <string_view>

namespace abbe::protocol {

/// Reads all of `text` as a decimal number with a decimal point, such as -1.5e-3 or +2. Sets
/// `value`. Returns the fault of the text ("not a number"); empty if it is valid.
[[nodiscard]] std::string_view parse_decimal(std::string_view text, double& value);

enum class DecimalKind { Any, Whole, WholeNotNegative };

/// The fault of `text` as the number of a command line option; empty if it is valid. Numbers that
/// other programs read with another value are refused: 010 is 8 in C and 10 in a table, 0x10 is 16
/// in C.
[[nodiscard]] std::string decimal_fault(std::string_view text, DecimalKind kind);

}  // namespace abbe::protocol

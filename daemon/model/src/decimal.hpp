#pragma once
/// Conversion of numbers between SI in memory and mm, um and urad in files. A written and read
/// number must be bit-identical; multiplying a double by 1e6 and dividing it again is not.
/// Therefore writing moves the decimal point in the text, and reading divides in long double, whose
/// 64-bit significand determines the double uniquely.

#include <string>

namespace abbe::daemon {

/// The text of `value * 10^shift` with the smallest number of digits (at most 17) that
/// from_decimal() converts back to the same bits. `value` must be finite.
[[nodiscard]] std::string to_decimal(double value, int shift);

/// `written / 10^shift` as a double; shift 0, 3, 6 or 12.
[[nodiscard]] double from_decimal(long double written, int shift);

}  // namespace abbe::daemon

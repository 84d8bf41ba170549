#pragma once
/// Numbers in files stand in mm, um and urad, in memory in m and rad, and must come back to the
/// same bits. Multiplying a double by 1e6 and dividing again does not: so the decimal point is
/// moved in the text when writing, and the division when reading is done in long double, whose 64
/// bits leave no doubt which double was meant.

#include <string>

namespace abbe::daemon {

/// `value * 10^shift`, the fewest digits (17 at most) that from_decimal() reads back to the same
/// bits. Finite only.
[[nodiscard]] std::string to_decimal(double value, int shift);

/// `written / 10^shift` as a double; shift 0, 3, 6 or 12.
[[nodiscard]] double from_decimal(long double written, int shift);

}  // namespace abbe::daemon

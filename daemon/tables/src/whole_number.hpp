#pragma once
/// Whole numbers in the cells of a table: positions, features, runs.

#include <fmt/format.h>

#include <cmath>
#include <string_view>

#include "abbe/base/parsed_table.hpp"

namespace abbe::daemon {

// Largest number of a position, feature (ball, block) or run: far above that of any procedure, and
// far below integer overflow.
inline constexpr int kMostNumber = 1000;

/// The cell as a whole number. If it is not a whole number of at least 1, adds a fault and returns
/// 1.
[[nodiscard]] inline int number_at(const NumberTable& table, std::size_t row, std::size_t column,
                                   std::string_view name, Faults& faults) {
  const double value = table.at(row, column);
  const bool valid = value >= 1.0 && value <= kMostNumber && value == std::floor(value);
  if (!valid && table.sound(row))
    faults.add_kind("whole number", table.line(row), 1, name,
                    fmt::format("{}: must be a whole number, 1 to {}", value, kMostNumber));
  return valid ? static_cast<int>(value) : 1;
}

}  // namespace abbe::daemon

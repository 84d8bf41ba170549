#pragma once
/// The numbers of one row, by which rows are compared.

#include <array>
#include <cstddef>

#include "abbe/base/parsed_table.hpp"

namespace abbe::daemon {

/// The first `Columns` cells of the row. Two rows that repeat each other in every digit have equal
/// cells.
template <std::size_t Columns>
[[nodiscard]] std::array<double, Columns> cells_of(const NumberTable& table, std::size_t row) {
  std::array<double, Columns> cells{};
  for (std::size_t column = 0; column < cells.size(); ++column)
    cells[column] = table.at(row, column);
  return cells;
}

}  // namespace abbe::daemon

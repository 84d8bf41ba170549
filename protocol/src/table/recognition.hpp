#pragma once
/// Names the usual reasons why a text is not CSV as abbe reads it: a spreadsheet's own format,
/// UTF-16, semicolons, tabs or spaces between the values, quotation marks, decimal commas, no
/// header line.

#include <string_view>

#include "abbe/protocol/table/faults.hpp"
#include "abbe/protocol/table/number_table.hpp"
#include "table/text.hpp"

namespace abbe::protocol {

/// Adds a fault and returns true if the bytes are not plain text: UTF-16, or a spreadsheet file.
[[nodiscard]] bool recognised_bytes(std::string_view text, Faults& faults);

/// Adds a fault for each reason that the first line gives (`lines` is positioned on it), and for
/// decimal commas in the lines after it. Returns true if it added one; the file is then not parsed.
[[nodiscard]] bool recognised_first_line(std::string_view first, Lines lines,
                                         const std::vector<TableForm>& forms, Faults& faults);

/// Adds a fault and returns true if quotation marks, semicolons or tabs explain why a row is not
/// parsed.
[[nodiscard]] bool recognised_row(std::string_view line, std::size_t number, Faults& faults);

/// True if decimal commas explain why a row has more cells than columns: the commas of "0,5" split
/// its values, and no cell has a decimal point.
[[nodiscard]] bool has_decimal_commas(std::string_view line, const TableForm& form,
                                      std::size_t columns);

/// Advice for decimal commas.
inline constexpr std::string_view kWritePoints =
    "write 0.5, not 0,5 (in a spreadsheet: export with a language that has decimal points, for "
    "example English)";

}  // namespace abbe::protocol

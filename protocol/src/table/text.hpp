#pragma once
/// The text of a CSV file: its lines and their cells.

#include <algorithm>
#include <cstddef>
#include <string_view>
#include <vector>

#include "abbe/protocol/decimal.hpp"
#include "table/spreadsheet_error.hpp"

namespace abbe::protocol {

[[nodiscard]] inline std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return text.substr(text.size());
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

/// True if the line is a comment: it begins with #, and its first cell is not an error value of a
/// spreadsheet, such as #N/A.
[[nodiscard]] inline bool is_comment(std::string_view content) {
  return content.starts_with('#') && !begins_with_spreadsheet_error(content);
}

/// Iterates over the lines of a text and counts them; skips comments and blank lines.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;  // byte order mark
  }

  /// False at the end of the text. Then ended() is false if the last line has no newline.
  bool next(std::string_view& line) {
    while (at_ < text_.size()) {
      const auto newline = text_.find('\n', at_);
      ended_ = newline != std::string_view::npos;
      line = text_.substr(at_, ended_ ? newline - at_ : std::string_view::npos);
      at_ += line.size() + 1;
      ++number_;
      const auto content = trimmed(line);
      if (!content.empty() && !is_comment(content)) return true;
    }
    return false;
  }
  [[nodiscard]] std::size_t number() const noexcept { return number_; }
  [[nodiscard]] bool ended() const noexcept { return ended_; }
  [[nodiscard]] double fraction() const {
    return static_cast<double>(std::min(at_, text_.size())) / static_cast<double>(text_.size());
  }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
  std::size_t number_ = 0;
  bool ended_ = true;
};

struct Cell {
  std::string_view text;   ///< trimmed
  std::size_t column = 1;  ///< column of the first character, counted from 1
};

/// Iterates over the cells of a line; next() returns false after the last one.
class Cells {
 public:
  explicit Cells(std::string_view line, char separator = ',')
      : line_(line), separator_(separator) {}
  bool next(Cell& cell) {
    if (at_ > line_.size()) return false;
    const auto end = std::min(line_.find(separator_, at_), line_.size());
    cell.text = trimmed(line_.substr(at_, end - at_));
    cell.column =
        1 + static_cast<std::size_t>(cell.text.empty() ? at_ : cell.text.data() - line_.data());
    at_ = end + 1;
    return true;
  }

 private:
  std::string_view line_;
  char separator_;
  std::size_t at_ = 0;
};

[[nodiscard]] inline std::vector<Cell> all_cells(std::string_view line, char separator = ',') {
  std::vector<Cell> cells;
  Cells cutter(line, separator);
  for (Cell cell; cutter.next(cell);) cells.push_back(cell);
  return cells;
}

/// Sets `value` to the number in the cell. Returns the fault of the cell; empty if it is valid.
[[nodiscard]] inline std::string_view parse_cell(std::string_view text, double& value) {
  return parse_decimal(text, value);
}

}  // namespace abbe::protocol

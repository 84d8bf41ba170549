#pragma once
/// Just enough CSV for the simulator's own inputs: a header row, `#` comments, no quotes. Errors
/// name file, line and column, all of a file at once (at most 20).

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/sim/error.hpp"

namespace abbe::sim {

struct CsvRow {
  std::size_t line = 0;
  std::vector<std::string_view> cells;  ///< trimmed; they point into the text that was read
};

struct CsvTable {
  std::vector<std::string_view> header;
  std::vector<CsvRow> rows;
};

class CsvErrors {
 public:
  explicit CsvErrors(std::string_view name) : name_(name) {}
  void add(std::size_t line, std::string_view text);
  [[nodiscard]] bool any() const { return count_ > 0; }
  [[nodiscard]] Error error() const { return {ErrorCode::BadInput, text_}; }

 private:
  std::string name_;
  std::string text_;
  std::size_t count_ = 0;
};

/// Splits `text`; a row with another number of cells than the header is an error. An empty header
/// means no header was found.
[[nodiscard]] CsvTable split_csv(std::string_view text, CsvErrors& errors);

/// The finite number in a cell, or an entry in `errors`.
[[nodiscard]] std::optional<double> csv_number(const CsvTable& table, const CsvRow& row,
                                               std::size_t column, CsvErrors& errors);

}  // namespace abbe::sim

#pragma once
/// A CSV reader for the simulator's own input files: a header row, `#` comments, no quotes. An
/// error text names file, line and column and lists all errors of a file (at most 20).

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/sim/error.hpp"

namespace abbe::sim {

struct CsvRow {
  std::size_t line = 0;
  std::vector<std::string_view> cells;  ///< trimmed; they refer to the text that was read
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

/// The number in a cell; nullopt and an entry in `errors` if it is not a finite number.
[[nodiscard]] std::optional<double> csv_number(const CsvTable& table, const CsvRow& row,
                                               std::size_t column, CsvErrors& errors);

}  // namespace abbe::sim

#pragma once
/// A CSV file of numbers, checked cell by cell. Written here because the libraries at hand
/// (fast-cpp-csv-parser, libcsv) stop at the first fault, do not know the column of a character,
/// and leave numbers to routines that are slow (strtod) or not correctly rounded; std::from_chars
/// is exact and reads some 10 million numbers a second.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "abbe/base/faults.hpp"
#include "abbe/base/input_file.hpp"

namespace abbe::daemon {

struct ColumnRule {
  std::string_view name;
  bool required = true;
  /// not a number but one of these; the value is its index
  std::vector<std::string_view> words = {};
};

/// The columns of one form of a file. A file may have several forms; the header decides.
using TableForm = std::vector<ColumnRule>;

/// Rows of finite numbers in the order of the form's columns; an absent optional column holds 0.
class NumberTable {
 public:
  NumberTable(std::size_t form, std::vector<bool> present)
      : form_(form), present_(std::move(present)) {}

  [[nodiscard]] std::size_t form() const noexcept { return form_; }  ///< which of the forms
  [[nodiscard]] bool has(std::size_t column) const { return present_[column]; }
  [[nodiscard]] std::size_t rows() const noexcept { return lines_.size(); }
  [[nodiscard]] double at(std::size_t row, std::size_t column) const {
    return values_[row * width() + column];
  }
  [[nodiscard]] std::size_t line(std::size_t row) const { return lines_[row]; }
  [[nodiscard]] bool sound(std::size_t row) const {
    return sound_[row];
  }  ///< every cell was a number
  [[nodiscard]] std::size_t width() const noexcept { return present_.size(); }

  [[nodiscard]] double* append(std::size_t line);  ///< a row of zeros to fill
  void mark_unsound() { sound_.back() = false; }   ///< the row appended last
  void reserve(std::size_t rows);

 private:
  std::size_t form_;
  std::vector<bool> present_;
  std::vector<double> values_;
  std::vector<std::uint32_t> lines_;
  std::vector<bool> sound_;
};

/// Adds a fault for everything wrong; the table is empty if the header cannot be understood.
[[nodiscard]] std::optional<NumberTable> parse_numbers(std::string_view text,
                                                       const std::vector<TableForm>& forms,
                                                       Faults& faults,
                                                       const ReadProgress& progress = {});

}  // namespace abbe::daemon

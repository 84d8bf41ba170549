#pragma once
/// A CSV file of numbers, checked cell by cell. Own implementation: the available libraries
/// (fast-cpp-csv-parser, libcsv) stop at the first fault, do not report the column of a character,
/// and convert numbers with routines that are slow (strtod) or do not round correctly.
/// std::from_chars rounds correctly and reads about 10 million numbers per second.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>
#include <vector>

#include "abbe/protocol/table/faults.hpp"

namespace abbe::protocol {

struct ColumnRule {
  std::string_view name;
  bool required = true;
  /// if not empty: the cell holds one of these words, and the value is the index of the word
  std::vector<std::string_view> words = {};
  bool may_be_empty = false;  ///< an empty cell is valid, and its value is NaN
};

/// The columns of one variant of a file format. The header decides which variant a file has.
using TableForm = std::vector<ColumnRule>;

/// Rows of finite numbers, in the column order of the form. An empty cell holds NaN if the column
/// allows it. An absent optional column holds 0.
class NumberTable {
 public:
  NumberTable(std::size_t form, std::vector<bool> present)
      : form_(form), present_(std::move(present)) {}

  [[nodiscard]] std::size_t form() const noexcept { return form_; }  ///< index in the list of forms
  [[nodiscard]] bool has(std::size_t column) const { return present_[column]; }
  [[nodiscard]] std::size_t rows() const noexcept { return lines_.size(); }
  [[nodiscard]] double at(std::size_t row, std::size_t column) const {
    return values_[row * width() + column];
  }
  [[nodiscard]] std::size_t line(std::size_t row) const { return lines_[row]; }
  /// True if the row had no fault: all cells present and valid.
  [[nodiscard]] bool sound(std::size_t row) const { return sound_[row]; }
  [[nodiscard]] std::size_t width() const noexcept { return present_.size(); }

  [[nodiscard]] double* append(std::size_t line);  ///< appends a row of zeros
  void mark_invalid() { sound_.back() = false; }   ///< applies to the last row
  void reserve(std::size_t rows);

 private:
  std::size_t form_;
  std::vector<bool> present_;
  std::vector<double> values_;
  std::vector<std::uint32_t> lines_;
  std::vector<bool> sound_;
};

/// Called repeatedly while a text is read; `fraction` ascends from 0 to 1. The function object may
/// be empty.
using ReadProgress = std::function<void(double fraction)>;

/// Adds one fault to `faults` for each error in the text. nullopt if the header is invalid.
[[nodiscard]] std::optional<NumberTable> parse_numbers(std::string_view text,
                                                       const std::vector<TableForm>& forms,
                                                       Faults& faults,
                                                       const ReadProgress& progress = {});

}  // namespace abbe::protocol

#pragma once
/// Assignment of rows to the folds of a cross-validation. Rows that share noise (the three
/// components of one touched ball, the balls of one position) must be in one fold. With folds over
/// single rows, the rows held out share noise with the fitted rows, and the error is too small.

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "abbe/calib/base/error.hpp"

namespace abbe::calib::sparse {

struct Folds {
  std::vector<int> of_row;  ///< 0 .. count-1
  int count = 0;            ///< every fold has a row
};

/// Each distinct label becomes one fold; folds are numbered by increasing label.
/// TooFewObservations with fewer than two distinct labels.
[[nodiscard]] Result<Folds> folds_from_labels(std::span<const int> label_of_row);

/// `text`: content of a file with one integer label per line, row by row. Empty lines are ignored;
/// a first line that is not an integer is a heading. BadInput names the line.
[[nodiscard]] Result<Folds> parse_folds(std::string_view text);

/// Rows distributed at random; fold sizes differ by at most one row. The same seed gives the same
/// folds on every platform. TooFewObservations with fewer rows than folds or fewer than two folds.
[[nodiscard]] Result<Folds> random_folds(std::size_t rows, int folds, std::uint64_t seed);

}  // namespace abbe::calib::sparse

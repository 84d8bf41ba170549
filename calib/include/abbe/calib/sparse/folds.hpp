#pragma once
/// Which row is held out when. Rows that share noise (the three components of one touched ball, the
/// balls of one position) belong in one fold: folds over single rows let a fit see the noise it is
/// judged by, and the error looks too small.

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "abbe/calib/error.hpp"

namespace abbe::calib::sparse {

struct Folds {
  std::vector<int> of_row;  ///< 0 .. count-1
  int count = 0;            ///< every fold has a row
};

/// Any labels, each distinct label one fold, numbered in increasing order. TooFewObservations with
/// less than two labels.
[[nodiscard]] Result<Folds> folds_from_labels(std::span<const int> label_of_row);

/// The text of a file: one integer a line, row by row; a first line that is no number is a heading.
/// BadInput names the line.
[[nodiscard]] Result<Folds> parse_folds(std::string_view text);

/// Rows dealt at random, sizes differ by at most one. The same seed gives the same folds
/// everywhere. TooFewObservations when there are fewer rows than folds or fewer than two folds.
[[nodiscard]] Result<Folds> random_folds(std::size_t rows, int folds, std::uint64_t seed);

/// Whole groups dealt at random; sizes in groups differ by at most one. folds = number of groups
/// leaves one group out at a time.
[[nodiscard]] Result<Folds> group_folds(std::span<const int> group_of_row, int folds,
                                        std::uint64_t seed);

}  // namespace abbe::calib::sparse

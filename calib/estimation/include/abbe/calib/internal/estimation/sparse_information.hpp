#pragma once
/// Information of many sparse rows. Rows that begin with the same column form a group, because they
/// have most columns in common: in on-the-fly calibration a group is the rows of one cell of the
/// first axis, with 103 of 169 unknowns. Each group is triangularised by itself, over the unknowns
/// that occur in it, and the triangles are merged. For n unknowns, m rows and groups of k unknowns
/// this takes m k^2 operations instead of m n^2.

#include <span>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::estimation {

/// A row of A with its y, and 1 / standard deviation of y.
struct WeightedRow {
  std::span<const RowEntry> entries;  ///< non-zero entries; columns in ascending order
  double y = 0.0;
  double root_weight = 1.0;
};

[[nodiscard]] Information information_of(std::size_t unknowns, std::span<const WeightedRow>);

}  // namespace abbe::calib::estimation

#pragma once
/// Collects rows of a linear problem before they are added to an Information (information.hpp).
/// Rows are added in batches, because the time for a batch depends little on its number of rows.

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

namespace abbe::calib::estimation {

/// A non-zero entry of a sparse row.
struct RowEntry {
  std::size_t column = 0;
  double value = 0.0;
};

/// Dense rows [A | y], already divided by the standard deviation of y. The memory is allocated
/// once.
class RowBatch {
 public:
  /// 16 rows of 170 columns fit into a first-level cache of 32 kB.
  static constexpr std::size_t kCapacity = 16;

  explicit RowBatch(std::size_t unknowns)
      : width_(unknowns + 1), values_(kCapacity * (unknowns + 1)) {}

  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] bool full() const { return count_ == kCapacity; }

  /// `root_weight`: 1 / standard deviation of y. The batch must not be full.
  void append(std::span<const RowEntry> row, double y, double root_weight) {
    double* to = values_.data() + count_++ * width_;
    for (const RowEntry& e : row) {
      to[e.column] += root_weight * e.value;
    }
    to[width_ - 1] = root_weight * y;
  }

  [[nodiscard]] double* data() { return values_.data(); }
  /// Removes the rows.
  void clear() {
    std::fill_n(values_.begin(), count_ * width_, 0.0);
    count_ = 0;
  }

 private:
  std::size_t width_ = 0, count_ = 0;
  std::vector<double> values_;
};

}  // namespace abbe::calib::estimation

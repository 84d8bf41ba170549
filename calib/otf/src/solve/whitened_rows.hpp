#pragma once
/// The rows of a run after subtraction of the noise that is predicted from earlier rows
/// (prewhitening.hpp).

#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/internal/otf/solve/prewhitening.hpp"
#include "abbe/calib/otf/observe/observe.hpp"
#include "solve/noise_whitening.hpp"

namespace abbe::calib::otf {

/// Prewhitened rows, or the original rows. Prewhitened rows have the sigma of the original rows if
/// their noise has the mean variance. `o` must outlive this object.
class WhitenedRows {
 public:
  /// Uses the original rows.
  explicit WhitenedRows(const Observations& o) : o_(o) {}
  WhitenedRows(const Observations& o, const TrackerNoise& noise);
  WhitenedRows(const WhitenedRows&) = delete;
  WhitenedRows& operator=(const WhitenedRows&) = delete;

  [[nodiscard]] std::span<const SparseRows::Entry> row(std::size_t i) const {
    return whitening_ ? A_.row(i) : o_.A.row(i);
  }
  /// False if the rows are the original ones.
  [[nodiscard]] bool are_sums() const { return whitening_.has_value(); }
  /// Applies the prewhitening to other columns of the rows.
  void apply(RowMatrix& columns) const;
  [[nodiscard]] std::vector<double> values(std::span<const double> of_rows) const;
  /// Mean variance of the noise of the rows relative to the stated variance.
  [[nodiscard]] double variance_factor() const { return variance_factor_; }
  /// Mean correlation with the previous row in the same direction and on the same leg.
  [[nodiscard]] double lag_1(std::size_t component) const { return lag_1_[component]; }

 private:
  const Observations& o_;
  NoiseSeries series_;
  std::optional<NoiseWhitening> whitening_;
  SparseRows A_;
  double variance_factor_ = 1.0, root_of_mean_variance_ = 1.0;
  std::array<double, 3> lag_1_{};
};

/// The row of the same component in the previous segment, if this segment is used and on the same
/// leg.
[[nodiscard]] std::optional<std::size_t> row_before(const Observations&, std::size_t i);

}  // namespace abbe::calib::otf

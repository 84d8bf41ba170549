#pragma once
/// The columns that the drift of the tracker and an offset of its ranges add to the rows of a run.
/// Order: the offset (only if it has a prior), the coefficients of the drift, and the coefficients
/// between its knots (only for BetweenKnots::Walk). A row has at most 13 entries in the first two
/// kinds, and 18 between the knots.

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "abbe/calib/otf/observe/observe.hpp"
#include "nests/drift_basis.hpp"
#include "solve/added_columns.hpp"
#include "solve/whitened_rows.hpp"

namespace abbe::calib::otf {

class DriftColumns {
 public:
  enum class BetweenKnots { Straight, Walk };

  /// The observations must have a drift and outlive this object. `offsets`: 1 with the range
  /// offset, else 0.
  explicit DriftColumns(const Observations& o, std::size_t offsets = 0,
                        BetweenKnots between = BetweenKnots::Straight)
      : o_(o), basis_(*o.drift), offsets_(offsets), between_(between) {}

  [[nodiscard]] std::size_t size() const {
    return offsets_ + basis_.size() + (between_ == BetweenKnots::Walk ? basis_.between_knots() : 0);
  }
  [[nodiscard]] const DriftBasis& basis() const { return basis_; }
  /// Change of y of the row that is caused by the coefficients d.
  [[nodiscard]] double effect_m(const Observation& row, const Eigen::VectorXd& d) const;
  /// Sums over the rows for which `take` returns true; over all rows if it is empty. `residual_m`:
  /// residuals of the original rows of the observations, not of the prewhitened rows.
  [[nodiscard]] AddedColumns sums(const WhitenedRows&, std::span<const double> residual_m,
                                  const std::function<bool(const Observation&)>& take = {}) const;

 private:
  using Entries = std::vector<SparseRows::Entry>;
  void append(const Observation& row, Entries& out) const;
  [[nodiscard]] RowMatrix prewhitened(const WhitenedRows&) const;

  const Observations& o_;
  DriftBasis basis_;
  std::size_t offsets_;
  BetweenKnots between_;
};

}  // namespace abbe::calib::otf

#pragma once
/// Rows from which the noise that the previous rows of the leg predict is subtracted.

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/otf/observe.hpp"
#include "abbe/calib/otf/prewhitening.hpp"

namespace abbe::calib::otf {

/// Row i becomes the sum of `factor` times row over its terms: of itself and of the same direction
/// of the blocks before it, as far as they are consecutive, used and on the same leg. Factors
/// contain the ratio of the sigmas, so that the noise of the sum has the sigma of row i. `o` must
/// outlive it.
class WhitenedRows {
 public:
  struct Term {
    std::size_t row = 0;
    double factor = 1.0;
  };

  /// The rows as they are.
  explicit WhitenedRows(const Observations& o) : o_(o) {}
  WhitenedRows(const Observations& o, const NoiseFilter& filter);

  [[nodiscard]] std::span<const SparseRows::Entry> row(std::size_t i) const {
    return white_ ? o_.A.row(i) : A_.row(i);
  }
  /// `of_row`: function of a row's index.
  template <class OfRow>
  [[nodiscard]] double value(std::size_t i, OfRow of_row) const {
    if (white_) {
      return of_row(i);
    }
    double sum = 0.0;
    for (const Term& term : terms(i)) {
      sum += term.factor * of_row(term.row);
    }
    return sum;
  }
  /// False if the rows are as they are: then they have no terms.
  [[nodiscard]] bool are_sums() const { return !white_; }
  [[nodiscard]] std::span<const Term> terms(std::size_t i) const {
    return std::span(terms_).subspan(first_term_[i], first_term_[i + 1] - first_term_[i]);
  }
  [[nodiscard]] std::vector<double> values(std::span<const double> of_rows) const;

 private:
  const Observations& o_;
  bool white_ = true;
  SparseRows A_;
  std::vector<Term> terms_;
  std::vector<std::size_t> first_term_{0};
};

/// The row of the same component in the block directly before that of row i, if this block is used
/// and on the same leg.
[[nodiscard]] std::optional<std::size_t> row_before(const Observations&, std::size_t i);
/// At most `most` rows of the same component in the used blocks directly before, latest first.
[[nodiscard]] std::vector<std::size_t> rows_before(const Observations&, std::size_t i,
                                                   std::size_t most);

}  // namespace abbe::calib::otf

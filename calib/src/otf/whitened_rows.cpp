#include "otf/whitened_rows.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::calib::otf {
namespace {

/// factor times row, added to `sum`; columns ascend in both.
void add_row(std::vector<SparseRows::Entry>& sum, std::span<const SparseRows::Entry> row,
             double factor) {
  auto at = sum.begin();
  for (const SparseRows::Entry& e : row) {
    at = std::lower_bound(
        at, sum.end(), e.column,
        [](const SparseRows::Entry& s, std::size_t column) { return s.column < column; });
    if (at == sum.end() || at->column != e.column) {
      at = sum.insert(at, {e.column, 0.0});
    }
    at->value += factor * e.value;
  }
}

}  // namespace

std::optional<std::size_t> row_before(const Observations& o, std::size_t i) {
  const Observation& row = o.rows[i];
  while (i > 0 && o.rows[i - 1].leg == row.leg && o.rows[i - 1].block + 1 >= row.block) {
    --i;
    if (o.rows[i].component == row.component) {
      return o.rows[i].block + 1 == row.block ? std::optional(i) : std::nullopt;
    }
  }
  return std::nullopt;
}

std::vector<std::size_t> rows_before(const Observations& o, std::size_t i, std::size_t most) {
  std::vector<std::size_t> found;
  while (found.size() < most) {
    const std::optional<std::size_t> before = row_before(o, i);
    if (!before) {
      break;
    }
    found.push_back(i = *before);
  }
  return found;
}

WhitenedRows::WhitenedRows(const Observations& o, const NoiseFilter& filter)
    : o_(o), white_(filter.is_white()) {
  std::vector<SparseRows::Entry> sum;
  for (std::size_t i = 0; !white_ && i < o.rows.size(); ++i) {
    const Autoregression& noise = filter.of_direction[o.rows[i].component];
    const std::vector<std::size_t> before = rows_before(o, i, noise.order);
    const std::size_t order = before.size();
    const double scale = 1.0 / std::sqrt(noise.variance[order]);
    const auto add = [&](std::size_t row, double factor) {
      terms_.push_back({row, factor});
      add_row(sum, o.A.row(row), factor);
    };

    sum.clear();
    add(i, scale);
    for (std::size_t lag = 1; lag <= order; ++lag) {
      const double ratio = o.rows[i].sigma_m / o.rows[before[lag - 1]].sigma_m;
      add(before[lag - 1], -scale * noise.coefficient[order][lag - 1] * ratio);
    }

    A_.append(sum);
    first_term_.push_back(terms_.size());
  }
}

std::vector<double> WhitenedRows::values(std::span<const double> of_rows) const {
  std::vector<double> all(of_rows.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i] = value(i, [&](std::size_t row) { return of_rows[row]; });
  }
  return all;
}

}  // namespace abbe::calib::otf

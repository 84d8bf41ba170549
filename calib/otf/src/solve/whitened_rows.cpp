#include "solve/whitened_rows.hpp"

#include <array>
#include <cmath>

namespace abbe::calib::otf {
namespace {

SlowNoise in_units_of_white(const TrackerNoise& noise) {
  const auto variance = [&](double s) { return s * s / noise.white_factor; };
  const double of_angle = variance(noise.slow_angle_rad);
  return {
      .variance = {variance(noise.slow_range_m), of_angle, of_angle, variance(noise.slow_along_m)},
      .correlation_time = noise.correlation_time};
}

/// Correlation of a row with the previous row: mean over the rows, by component.
std::array<double, 3> correlations(const Observations& o, const NoiseSeries& series,
                                   const SlowNoise& noise) {
  const SlowNoiseStep step = slow_noise_step(series.segment_duration(), noise.correlation_time);
  const auto product = [&](std::size_t i, std::size_t j) {
    double sum = 0.0;
    for (std::size_t s = 0; s < series.sources; ++s) {
      sum += noise.variance[s] * series.response[i][s] * series.response[j][s];
    }
    return sum;
  };
  const auto variance = [&](std::size_t i) {
    return 1.0 + step.stationary_variance_m() * product(i, i);
  };

  std::array<double, 3> sum{}, pairs{};
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    if (const auto before = row_before(o, i)) {
      sum[o.rows[i].component] +=
          step.mean * step.mean * product(i, *before) / std::sqrt(variance(i) * variance(*before));
      pairs[o.rows[i].component] += 1.0;
    }
  }
  for (std::size_t c = 0; c < sum.size(); ++c) {
    sum[c] = pairs[c] > 0.0 ? sum[c] / pairs[c] : 0.0;
  }
  return sum;
}

}  // namespace

std::optional<std::size_t> row_before(const Observations& o, std::size_t i) {
  const Observation& row = o.rows[i];
  while (i > 0 && o.rows[i - 1].leg == row.leg && o.rows[i - 1].segment + 1 >= row.segment) {
    --i;
    if (o.rows[i].component == row.component) {
      return o.rows[i].segment + 1 == row.segment ? std::optional(i) : std::nullopt;
    }
  }
  return std::nullopt;
}

WhitenedRows::WhitenedRows(const Observations& o, const TrackerNoise& noise)
    : o_(o), series_(noise_series(o)) {
  const SlowNoise slow = in_units_of_white(noise);
  whitening_.emplace(series_, slow);
  variance_factor_ = noise.white_factor * whitening_->mean_variance();
  root_of_mean_variance_ = std::sqrt(whitening_->mean_variance());
  lag_1_ = correlations(o, series_, slow);

  RowMatrix A = RowMatrix::Zero(std::ssize(o.rows), static_cast<Eigen::Index>(o.unknowns()));
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    for (const SparseRows::Entry& e : o.A.row(i)) {
      A(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(e.column)) = e.value;
    }
  }
  apply(A);

  // Entries below this fraction are left out: the prediction from earlier rows decreases with their
  // age, and so do the entries of their nodes.
  constexpr double kNegligible = 1e-10;
  std::vector<SparseRows::Entry> row;
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    row.clear();
    const double least = kNegligible * A.row(i).cwiseAbs().maxCoeff();
    for (Eigen::Index j = 0; j < A.cols(); ++j) {
      if (std::abs(A(i, j)) > least) {
        row.push_back({static_cast<std::size_t>(j), A(i, j)});
      }
    }
    A_.append(row);
  }
}

void WhitenedRows::apply(RowMatrix& columns) const {
  if (!whitening_) {
    return;
  }
  for (std::size_t i = 0; i < o_.rows.size(); ++i) {
    columns.row(static_cast<Eigen::Index>(i)) /= o_.rows[i].sigma_m;
  }
  whitening_->apply(columns);
  for (std::size_t i = 0; i < o_.rows.size(); ++i) {
    columns.row(static_cast<Eigen::Index>(i)) *= o_.rows[i].sigma_m * root_of_mean_variance_;
  }
}

std::vector<double> WhitenedRows::values(std::span<const double> of_rows) const {
  RowMatrix column = Eigen::Map<const RowMatrix>(of_rows.data(), std::ssize(of_rows), 1);
  apply(column);
  return {column.data(), column.data() + column.size()};
}

}  // namespace abbe::calib::otf

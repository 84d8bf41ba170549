#include "abbe/calib/otf/prewhitening.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "abbe/calib/estimation/sparse_information.hpp"
#include "abbe/calib/otf/lack_of_fit.hpp"
#include "check_stopped.hpp"
#include "otf/row_residuals.hpp"
#include "otf/systematic_effects.hpp"
#include "otf/whitened_rows.hpp"
#include "otf/with_drift.hpp"
#include "quantile_999.hpp"

namespace abbe::calib::otf {
namespace {

constexpr std::size_t kLags = Autoregression::kMostOrder;

/// Autocorrelations of the whitened residuals of the rows of one component.
struct Autocorrelation {
  std::array<double, kLags + 1> coefficient{1.0};  ///< by lag, in blocks
  double pairs = 0.0;                              ///< of neighbours
};

Autocorrelation autocorrelation(const Observations& o, std::span<const double> residual_m,
                                std::size_t component) {
  std::array<double, kLags + 1> products{}, pairs{};
  const auto w = [&](std::size_t i) { return residual_m[i] / o.rows[i].sigma_m; };
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    if (o.rows[i].component != component) {
      continue;
    }
    products[0] += w(i) * w(i);
    pairs[0] += 1.0;
    std::size_t lag = 0;
    for (const std::size_t before : rows_before(o, i, kLags)) {
      ++lag;
      products[lag] += w(i) * w(before);
      pairs[lag] += 1.0;
    }
  }

  Autocorrelation found;
  found.pairs = pairs[1];
  for (std::size_t lag = 1; lag <= kLags && pairs[lag] > 0.0 && products[0] > 0.0; ++lag) {
    found.coefficient[lag] = products[lag] / pairs[lag] / (products[0] / pairs[0]);
  }
  return found;
}

/// Recursion of Levinson and Durbin, up to the first order that is not significant.
Autoregression autoregression(const Autocorrelation& of) {
  // 99.9 % quantile; for a lower order the last coefficient has standard
  // deviation 1/sqrt(n)
  const double significant = kNormal999 / std::sqrt(std::max(1.0, of.pairs));
  Autoregression found;

  for (std::size_t k = 1; k <= kLags; ++k) {
    const auto& shorter = found.coefficient[k - 1];
    double last = of.coefficient[k];
    for (std::size_t j = 1; j < k; ++j) {
      last -= shorter[j - 1] * of.coefficient[k - j];
    }
    last /= found.variance[k - 1];

    const bool first_is_positive = k > 1 || last > 0.0;
    if (!first_is_positive || !(std::abs(last) > significant) || !(std::abs(last) < 1.0)) {
      break;
    }

    found.order = k;
    found.coefficient[k][k - 1] = last;
    for (std::size_t j = 1; j < k; ++j) {
      found.coefficient[k][j - 1] = shorter[j - 1] - last * shorter[k - j - 1];
    }
    found.variance[k] = found.variance[k - 1] * (1.0 - last * last);
  }

  return found;
}

RowInformation information_of(const Observations& o, const WhitenedRows& rows) {
  std::vector<estimation::WeightedRow> weighted;
  weighted.reserve(o.rows.size());
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const double y_m = rows.value(i, [&](std::size_t row) { return o.rows[row].y_m; });
    weighted.push_back({rows.row(i), y_m, 1.0 / o.rows[i].sigma_m});
  }

  RowInformation information(o.unknowns());
  information.data = estimation::information_of(o.unknowns(), weighted);
  return information;
}

/// The adjustment of prewhitened rows, with all effects in the covariance.
struct Whitened {
  Eigen::VectorXd U;
  Eigen::MatrixXd covariance;
  std::vector<double> residual_m;  ///< of the observations' own rows
  double variance_factor = 1.0;
  std::optional<OffsetInModel> offset_in_model{};
};

Result<Whitened> adjust_whitened(const Observations& o, const NoiseFilter& filter,
                                 const Options& options) {
  if (Result<void> running = check_stopped(options.stopped); !running) {
    return tl::unexpected(running.error());
  }

  const WhitenedRows rows(o, filter);
  const Result<Adjustment> a = adjust(information_of(o, rows), o, options.gauge_weight);
  if (!a) {
    return tl::unexpected(a.error());
  }

  const std::size_t dof = o.rows.size() - a->rank;
  const auto factor = [&](std::span<const double> residual_m) {
    return residual_noise(o, rows.values(residual_m), dof).variance_factor();
  };

  Whitened w{a->U, {}, residuals_m(o, a->U)};
  w.variance_factor = factor(w.residual_m);
  Eigen::MatrixXd of_offset = Eigen::MatrixXd::Zero(a->U.size(), 1);
  std::optional<WithDrift> drift;

  if (o.drift) {
    Result<WithDrift> with = with_drift(o, rows, *a, w.residual_m, factor, options.stopped);
    if (!with) {
      return tl::unexpected(with.error());
    }
    drift = *std::move(with);
    w.U = std::move(drift->U);
    w.residual_m = std::move(drift->residual_m);
    w.variance_factor = factor(w.residual_m);
  } else if (o.u_range_offset_m > 0.0) {
    WithRangeOffset with = with_range_offset(o, rows, *a, w.residual_m, w.variance_factor);
    w.U = std::move(with.U);
    w.residual_m = std::move(with.residual_m);
    w.variance_factor = factor(w.residual_m);
    of_offset = std::move(with.root_of_covariance);
    w.offset_in_model = std::move(with.in_model);
  }

  w.covariance = w.variance_factor * a->covariance;
  w.covariance += of_offset * of_offset.transpose();
  if (drift) {
    w.covariance += drift->added_covariance;
  }
  add_scale_effects(w.covariance, o, rows, a->cofactor_Q);
  return w;
}

/// The observations for an adjustment of prewhitened rows whose variance factor is `factor`.
Observations with_variance_factor(Observations o, double factor) {
  if (o.smoothness) {
    o.smoothness->variance_factor = factor;
  }
  return o;
}

}  // namespace

NoiseFilter noise_filter(const Observations& o, std::span<const double> residual_m) {
  return {{autoregression(autocorrelation(o, residual_m, 0)),
           autoregression(autocorrelation(o, residual_m, 1)),
           autoregression(autocorrelation(o, residual_m, kAlong))}};
}

Result<Solution> prewhitened(Solution s, const Observations& o, const Options& options) {
  const NoiseFilter first = noise_filter(o, s.residuals.after_m);
  const bool stated_noise_is_larger = s.statistics.variance_factor <= 1.0;
  if (first.is_white() || stated_noise_is_larger) {
    return s;
  }

  const Result<Whitened> of_first = adjust_whitened(with_variance_factor(o, 1.0), first, options);
  if (!of_first) {
    return tl::unexpected(of_first.error());
  }

  const NoiseFilter filter = noise_filter(o, of_first->residual_m);
  Result<Whitened> w =
      adjust_whitened(with_variance_factor(o, of_first->variance_factor), filter, options);
  if (!w) {
    return tl::unexpected(w.error());
  }

  Result<VolumetricModel> model =
      model_of(o, std::array{o.target_offset_m}, w->U, w->covariance, s.model.validity());
  if (!model) {
    return tl::unexpected(model.error());
  }

  s.model = *std::move(model);
  s.rigid = w->U.segment<kRigidUnknowns>(static_cast<Eigen::Index>(o.rigid_offset()));
  s.backlash = backlash_of(o, w->U, w->covariance);
  s.clock = w->U.tail(static_cast<Eigen::Index>(o.clock_unknowns));
  s.covariance_with_rigid = std::move(w->covariance);
  s.offset_in_model = std::move(w->offset_in_model);
  s.statistics.variance_factor = w->variance_factor;
  s.statistics.noise_correlation = {filter.of_direction[0].lag_1(), filter.of_direction[1].lag_1()};
  return s;
}

}  // namespace abbe::calib::otf

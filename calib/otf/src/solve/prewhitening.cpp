#include "abbe/calib/internal/otf/solve/prewhitening.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/estimation/sparse_information.hpp"
#include "abbe/calib/internal/otf/observe/row_residuals.hpp"
#include "abbe/calib/internal/statistics/quantile_999.hpp"
#include "abbe/calib/otf/solve/residual_noise.hpp"
#include "abbe/result/try.hpp"
#include "solve/systematic_effects.hpp"
#include "solve/whitened_rows.hpp"
#include "solve/with_drift.hpp"

namespace abbe::calib::otf {
namespace {

/// True if the correlation of the whitened residuals of neighbouring rows in one direction exceeds
/// the 99.9 % quantile for white noise. For white noise its standard deviation is 1/sqrt(pairs).
bool is_correlated_in(const Observations& o, std::span<const double> residual_m,
                      std::size_t component) {
  double products = 0.0, squares = 0.0, pairs = 0.0, rows = 0.0;
  const auto w = [&](std::size_t i) { return residual_m[i] / o.rows[i].sigma_m; };
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    if (o.rows[i].component != component) {
      continue;
    }
    squares += w(i) * w(i);
    rows += 1.0;
    if (const std::optional<std::size_t> before = row_before(o, i)) {
      products += w(i) * w(*before);
      pairs += 1.0;
    }
  }
  if (!(pairs > 0.0) || !(squares > 0.0)) {
    return false;
  }
  return products / pairs / (squares / rows) > kNormal999 / std::sqrt(pairs);
}

RowInformation information_of(const Observations& o, const WhitenedRows& rows) {
  std::vector<estimation::WeightedRow> weighted;
  weighted.reserve(o.rows.size());
  const std::vector<double> y_m = rows.values(residuals_m(o, {}));
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    weighted.push_back({rows.row(i), y_m[i], 1.0 / o.rows[i].sigma_m});
  }

  RowInformation information(o.unknowns());
  information.data = estimation::information_of(o.unknowns(), weighted);
  return information;
}

/// Result of the adjustment of prewhitened rows, with all effects in the covariance.
struct Whitened {
  Eigen::VectorXd U;
  Eigen::MatrixXd covariance;
  std::vector<double> residual_m;  ///< residuals of the original rows
  double variance_factor = 1.0;
  std::optional<OffsetInModel> offset_in_model{};
  Eigen::MatrixXd covariance_of_noise{};
  std::optional<TwoAxisErrors> two_axes{};
};

Result<Whitened> adjust_whitened(const Observations& o, const WhitenedRows& rows,
                                 const Options& options) {
  ABBE_TRY(check_stopped(options.stopped));

  const Result<Adjustment> a = adjust(information_of(o, rows), o, options.datum_weight);
  ABBE_TRY(a);

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
    ABBE_TRY(with);
    drift = *std::move(with);
    w.U = std::move(drift->U);
    w.residual_m = std::move(drift->residual_m);
    w.variance_factor = factor(w.residual_m);
  } else {
    WithRunEffects with = with_run_effects(o, rows, *a, w.residual_m, w.variance_factor);
    w.two_axes = with.two_axes;
    w.U = std::move(with.U);
    w.residual_m = std::move(with.residual_m);
    w.variance_factor = factor(w.residual_m);
    of_offset = std::move(with.root_of_covariance);
    w.offset_in_model = std::move(with.in_model);
  }

  w.covariance = w.variance_factor * a->covariance;
  w.covariance_of_noise = w.covariance;
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

bool is_correlated(const Observations& o, std::span<const double> residual_m) {
  return is_correlated_in(o, residual_m, 0) || is_correlated_in(o, residual_m, 1) ||
         is_correlated_in(o, residual_m, kAlong);
}

Result<Solution> prewhitened(Solution s, const Observations& o, const Options& options) {
  const bool stated_noise_is_larger = s.statistics.variance_factor <= 1.0;
  if (stated_noise_is_larger || !is_correlated(o, s.residuals.after_m)) {
    return s;
  }

  const Result<TrackerNoise> noise = estimate_noise(o, s.residuals.after_m, options);
  ABBE_TRY(noise);

  const WhitenedRows rows(o, *noise);
  Result<Whitened> w =
      adjust_whitened(with_variance_factor(o, rows.variance_factor()), rows, options);
  ABBE_TRY(w);

  Result<VolumetricModel> model =
      model_of(o, std::array{o.target_offset_m}, w->U, w->covariance, s.model.validity());
  ABBE_TRY(model);

  s.model = *std::move(model);
  s.rigid = w->U.segment<kRigidUnknowns>(static_cast<Eigen::Index>(o.rigid_offset()));
  s.backlash = backlash_of(o, w->U, w->covariance);
  s.clock = w->U.tail(static_cast<Eigen::Index>(o.clock_unknowns));
  s.covariance_with_rigid = std::move(w->covariance);
  s.offset_in_model = std::move(w->offset_in_model);
  s.fit = {std::move(w->U), std::move(w->residual_m), std::move(w->covariance_of_noise),
           noise->correlation_time, w->two_axes};
  s.statistics.variance_factor = w->variance_factor;
  s.statistics.noise_correlation = {rows.lag_1(0), rows.lag_1(1)};
  return s;
}

}  // namespace abbe::calib::otf

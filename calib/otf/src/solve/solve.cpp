#include "abbe/calib/otf/solve/solve.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/model/misfit_in_V.hpp"
#include "abbe/calib/internal/otf/observe/row_residuals.hpp"
#include "abbe/calib/otf/solve/residual_noise.hpp"
#include "abbe/result/try.hpp"
#include "run/progress.hpp"
#include "solve/find_misfit.hpp"
#include "solve/run_statistics.hpp"
#include "solve/systematic_effects.hpp"
#include "solve/whitened_rows.hpp"
#include "solve/with_drift.hpp"

namespace abbe::calib::otf {
namespace {

ResidualStatistics residual_statistics(const Observations& o, std::span<const double> r) {
  ResidualStatistics s;
  for (const double v : r) {
    s.mean_abs_m += std::abs(v);
    s.rms_m += v * v;
    s.max_abs_m = std::max(s.max_abs_m, std::abs(v));
  }
  const double n = static_cast<double>(std::max<std::size_t>(1, r.size()));
  s.mean_abs_m /= n;
  s.rms_m = std::sqrt(s.rms_m / n);
  s.weighted_rms = std::sqrt(chi2(o, r) / n);
  return s;
}

}  // namespace

double variance_factor(const ResidualNoise& noise, std::size_t dof) {
  // 99.9 % quantile; chi2/dof has standard deviation sqrt(2/dof)
  constexpr double kNormal999 = 3.090;
  const double unsuspicious = 1.0 + kNormal999 * std::sqrt(2.0 / static_cast<double>(dof));
  const double factor = noise.variance_factor();
  return factor > unsuspicious ? factor : 1.0;
}

Statistics statistics(const Observations& o, const Adjustment& a, const Residuals& residuals) {
  Statistics s;
  s.samples = o.samples;
  s.lost_samples = o.lost_samples;
  s.segments = o.segments;
  s.segments_used = o.segments_used;
  s.observations = o.rows.size();
  s.unknowns = o.unknowns();
  s.rank = a.rank;
  s.datum_conditions = a.datum_defect;
  s.degrees_of_freedom = s.observations - s.rank;
  s.condition = a.condition;
  s.chi2 = chi2(o, residuals.after_m);
  s.chi2_per_dof = s.chi2 / static_cast<double>(s.degrees_of_freedom);
  s.sigma0 = std::sqrt(s.chi2_per_dof);
  const ResidualNoise noise = residual_noise(o, residuals.after_m, s.degrees_of_freedom);
  s.correlation = noise.correlation;
  s.variance_factor = variance_factor(noise, s.degrees_of_freedom);
  s.before = residual_statistics(o, residuals.before_m);
  s.after = residual_statistics(o, residuals.after_m);
  s.iterations = 1;
  s.alignment_iterations = o.alignment.iterations;
  s.alignment_rms_m = o.alignment.last_rms_m;

  return s;
}

double segment_distance(const Observations& o) {
  if (o.segment_s.size() < 2) {
    return 1.0;
  }
  return (o.segment_s.back() - o.segment_s.front()) / static_cast<double>(o.segment_s.size() - 1);
}

namespace {

Result<void> check_enough(const Observations& o) {
  const std::size_t needed = o.unknowns();
  if (o.rows.size() <= needed) {
    return failure(
        ErrorCode::TooFewObservations,
        message("adjustment: ", o.rows.size(), " observations for ", needed, " unknowns"));
  }
  return {};
}

}  // namespace

std::string_view stop_reason(Estimator estimator) {
  return estimator == Estimator::Simultaneous ? "converged" : "direct";
}

std::vector<double> residuals_m(const Observations& o, const Eigen::VectorXd& U) {
  std::vector<double> r(o.rows.size());
  for (std::size_t i = 0; i < r.size(); ++i) {
    r[i] = o.rows[i].y_m;
    if (U.size() > 0) {
      for (const SparseRows::Entry& e : o.A.row(i)) {
        r[i] -= e.value * U(static_cast<Eigen::Index>(e.column));
      }
    }
  }
  return r;
}

double chi2(const Observations& o, std::span<const double> r) {
  double sum = 0.0;
  for (std::size_t i = 0; i < r.size(); ++i) {
    const double whitened = r[i] / o.rows[i].sigma_m;
    sum += whitened * whitened;
  }
  return sum;
}

Result<Solution> solve(const Observations& o, const Options& options) {
  ABBE_TRY(check_enough(o));
  report(options, Stage::Solve, 0.0);
  return solve(o, information_of(o), options);
}

Result<Solution> solve(const Observations& o, const RowInformation& rows, const Options& options) {
  ABBE_TRY(check_enough(o));

  report(options, Stage::Solve, 0.5);
  ABBE_TRY(check_stopped(options.stopped));

  Result<Adjustment> a = adjust(rows, o, options.datum_weight);
  ABBE_TRY(a);

  Result<ValidityVolume> validity = ValidityVolume::hull_of(o.covered_m);
  ABBE_TRY(validity);

  const Adjustment of_rows = *a;
  const WhitenedRows as_observed(o);
  Residuals residuals{residuals_m(o, {}), residuals_m(o, a->U)};
  Statistics figures = statistics(o, *a, residuals);
  RangeOffset offset;
  Eigen::MatrixXd root_of_offset = Eigen::MatrixXd::Zero(a->U.size(), 1);
  std::optional<OffsetInModel> offset_in_model;
  std::optional<TwoAxisErrors> two_axes;
  std::optional<WithDrift> drift;

  if (o.drift) {
    const auto variance = [&](std::span<const double> r_m) {
      return variance_factor(residual_noise(o, r_m, figures.degrees_of_freedom),
                             figures.degrees_of_freedom);
    };
    Result<WithDrift> with =
        with_drift(o, as_observed, *a, residuals.after_m, variance, options.stopped);
    ABBE_TRY(with);
    drift = *std::move(with);
    offset = drift->offset;
    a->U = std::move(drift->U);
    residuals.after_m = std::move(drift->residual_m);
    figures = statistics(o, *a, residuals);
  } else {
    WithRunEffects with =
        with_run_effects(o, as_observed, *a, residuals.after_m, figures.variance_factor);
    offset = with.offset;
    two_axes = with.two_axes;
    root_of_offset = std::move(with.root_of_covariance);
    offset_in_model = std::move(with.in_model);
    a->U = std::move(with.U);
    residuals.after_m = std::move(with.residual_m);
    figures = statistics(o, *a, residuals);
  }

  // `fit` describes the actual noise of the residuals, also if it is smaller than the stated noise.
  FitOfRows fit{a->U, residuals.after_m, figures.chi2_per_dof * figures.correlation * a->covariance,
                figures.correlation * segment_distance(o), two_axes};
  a->covariance *= figures.variance_factor;
  a->covariance += root_of_offset * root_of_offset.transpose();
  if (drift) {
    a->covariance += drift->added_covariance;
  }
  add_scale_effects(a->covariance, o, as_observed, a->cofactor_Q);

  Result<VolumetricModel> model =
      model_of(o, std::array{o.target_offset_m}, a->U, a->covariance, *std::move(validity));

  ABBE_TRY(model);

  report(options, Stage::Solve, 1.0);
  return Solution{
      .estimator = Estimator::TwoStep,
      .model = *std::move(model),
      .rigid = a->U.segment<kRigidUnknowns>(static_cast<Eigen::Index>(o.rigid_offset())),
      .clock = a->U.tail(static_cast<Eigen::Index>(o.clock_unknowns)),
      .covariance_with_rigid = a->covariance,
      .adjustment = of_rows,
      .T_machine_tracker = o.alignment.T_machine_tracker,
      .statistics = figures,
      .residuals = std::move(residuals),
      .range_offset = offset,
      .two_axes = two_axes,
      .backlash = backlash_of(o, a->U, a->covariance),
      .drift = drift ? std::optional(std::move(drift->drift)) : std::nullopt,
      .smoothness = o.smoothness,
      .offset_in_model = std::move(offset_in_model),
      .fit = std::move(fit)};
}

Result<Solution> with_misfit(Solution s, Observations& o) {
  std::vector<std::size_t> at(o.unknowns());
  std::iota(at.begin(), at.end(), std::size_t{0});
  const ResidualsOfRun run{o, s.fit.residual_m, std::move(at), s.fit.correlation_time,
                           s.fit.two_axes};
  std::optional<FoundMisfit> found =
      find_misfit(std::span(&run, 1), s.fit.covariance_of_noise, s.adjustment.cofactor_Q);
  if (!found) {
    return s;
  }

  const Eigen::MatrixXd covariance =
      s.covariance_with_rigid + found->root_of_covariance * found->root_of_covariance.transpose();
  Result<VolumetricModel> model =
      model_of(o, std::array{o.target_offset_m}, s.fit.U, covariance, s.model.validity())
          .and_then([&](const VolumetricModel& of_tables) {
            return of_tables.with_misfit(std::move(found->misfit));
          });
  ABBE_TRY(model);
  if (!is_notable_misfit(*model)) {
    return s;
  }
  s.model = *std::move(model);
  s.covariance_with_rigid = covariance;
  s.backlash = backlash_of(o, s.fit.U, s.covariance_with_rigid);
  o.notes.insert(o.notes.end(), found->notes.begin(), found->notes.end());
  return s;
}

}  // namespace abbe::calib::otf

#include "abbe/calib/otf/identify/targets.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/model/misfit_in_V.hpp"
#include "abbe/calib/internal/otf/observe/row_residuals.hpp"
#include "abbe/result/try.hpp"
#include "identify/drift_of_runs.hpp"
#include "identify/observed_runs.hpp"
#include "solve/added_columns.hpp"
#include "solve/find_misfit.hpp"
#include "solve/priors.hpp"
#include "solve/run_statistics.hpp"
#include "solve/run_unknowns.hpp"
#include "solve/systematic_effects.hpp"
#include "solve/with_drift.hpp"

namespace abbe::calib::otf {
namespace {

std::vector<Residuals> residuals_of_runs(std::span<const Observations> runs,
                                         const Eigen::VectorXd& U) {
  const RunUnknowns unknowns(runs);
  std::vector<Residuals> all;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    all.push_back({residuals_m(runs[k], {}), residuals_m(runs[k], unknowns.part(U, k))});
  }
  return all;
}

/// The part of the adjustment of all runs for the unknowns of one run. Its rank is that of all runs
/// times the share of its rows.
Adjustment adjustment_of_run(const Adjustment& of_all, std::span<const Observations> runs,
                             std::size_t run) {
  const RunUnknowns unknowns(runs);
  const double share =
      static_cast<double>(runs[run].rows.size()) / static_cast<double>(rows_of_runs(runs));
  Adjustment part = of_all;
  part.U = unknowns.part(of_all.U, run);
  part.covariance = unknowns.block(of_all.covariance, run);
  part.cofactor_Q = unknowns.block(of_all.cofactor_Q, run);
  part.rank = static_cast<std::size_t>(std::lround(share * static_cast<double>(of_all.rank)));
  return part;
}

ResidualStatistics statistics_joined(std::span<const Statistics> runs,
                                     ResidualStatistics Statistics::*which) {
  ResidualStatistics all;
  double rows = 0.0;
  for (const Statistics& s : runs) {
    const auto n = static_cast<double>(s.observations);
    const ResidualStatistics& r = s.*which;
    all.mean_abs_m += n * r.mean_abs_m;
    all.rms_m += n * r.rms_m * r.rms_m;
    all.weighted_rms += n * r.weighted_rms * r.weighted_rms;
    all.max_abs_m = std::max(all.max_abs_m, r.max_abs_m);
    rows += n;
  }
  all.mean_abs_m /= rows;
  all.rms_m = std::sqrt(all.rms_m / rows);
  all.weighted_rms = std::sqrt(all.weighted_rms / rows);
  return all;
}

Statistics statistics_of_all(std::span<const Statistics> runs, const Adjustment& a,
                             std::size_t unknowns) {
  Statistics s;
  for (const Statistics& run : runs) {
    s.samples += run.samples;
    s.lost_samples += run.lost_samples;
    s.segments += run.segments;
    s.segments_used += run.segments_used;
    s.observations += run.observations;
    s.chi2 += run.chi2;
    s.correlation = std::max(s.correlation, run.correlation);
    s.variance_factor = std::max(s.variance_factor, run.variance_factor);
    s.alignment_iterations = std::max(s.alignment_iterations, run.alignment_iterations);
    s.alignment_rms_m = std::max(s.alignment_rms_m, run.alignment_rms_m);
  }

  s.unknowns = unknowns;
  s.rank = a.rank;
  s.datum_conditions = a.datum_defect;
  s.condition = a.condition;
  s.degrees_of_freedom = s.observations - s.rank;
  s.chi2_per_dof = s.chi2 / static_cast<double>(s.degrees_of_freedom);
  s.sigma0 = std::sqrt(s.chi2_per_dof);
  s.variance_factor = std::max(
      s.variance_factor,
      variance_factor({.sigma0 = s.sigma0, .correlation = s.correlation}, s.degrees_of_freedom));
  s.before = statistics_joined(runs, &Statistics::before);
  s.after = statistics_joined(runs, &Statistics::after);
  return s;
}

std::vector<Statistics> statistics_of_runs(std::span<const Observations> runs, const Adjustment& a,
                                           std::span<const Residuals> residuals) {
  std::vector<Statistics> all;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    all.push_back(statistics(runs[k], adjustment_of_run(a, runs, k), residuals[k]));
  }
  return all;
}

/// The entries of a row with their indices among the unknowns of all runs.
std::vector<SparseRows::Entry> entries_at(std::span<const SparseRows::Entry> row,
                                          std::span<const std::size_t> at) {
  std::vector<SparseRows::Entry> entries(row.begin(), row.end());
  for (SparseRows::Entry& e : entries) {
    e.column = at[e.column];
  }
  return entries;
}

/// Estimates the range offset of each run, with its prior.
AddedColumns::Estimate estimate_offsets(std::span<const Observations> runs, const Adjustment& a,
                                        std::span<const Residuals> residuals, double factor) {
  const RunUnknowns unknowns(runs);
  AddedColumns sums(runs.size(), unknowns.size());
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const Observations& o = runs[k];
    const std::vector<std::size_t> at = unknowns.of_run(k);
    for (std::size_t i = 0; i < o.rows.size(); ++i) {
      const SparseRows::Entry c{k, drow_drange_offset(o, o.rows[i])};
      sums.add(o.rows[i], entries_at(o.A.row(i), at), residuals[k].after_m[i], std::span(&c, 1));
    }
  }
  return sums.estimate_with_prior(a.cofactor_Q, runs.front().u_range_offset_m, factor);
}

void subtract_offsets(std::vector<Residuals>& residuals, std::span<const Observations> runs,
                      const Eigen::VectorXd& U, std::span<const RangeOffset> offsets) {
  const RunUnknowns unknowns(runs);
  for (std::size_t k = 0; k < runs.size(); ++k) {
    residuals[k].after_m =
        residuals_m(without_range_offset(runs[k], offsets[k].value_m), unknowns.part(U, k));
  }
}

void add_scales_of_runs(Eigen::MatrixXd& covariance, std::span<const Observations> runs,
                        const Eigen::MatrixXd& Q) {
  const RunUnknowns unknowns(runs);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(Q.rows());
  for (std::size_t k = 0; k < runs.size(); ++k) {
    g(unknowns.of_run(k)) += dg_drange_scale(runs[k], WhitenedRows(runs[k]));
  }
  const Eigen::VectorXd of_ranges = runs.front().u_scale * (Q * g);
  covariance += of_ranges * of_ranges.transpose();

  for (const Axis axis : kAllAxes) {
    Eigen::VectorXd of_axis = Eigen::VectorXd::Zero(Q.rows());
    of_axis(unknowns.of_run(0)) =
        runs.front().u_axis_scale[index(axis)] * dU_daxis_scale(runs.front(), axis);
    covariance += of_axis * of_axis.transpose();
  }
}

Result<VolumetricModel> model_of_runs(std::span<const Observations> runs, const Adjustment& a) {
  std::vector<Vector3> covered_m, tools_m;
  for (const Observations& o : runs) {
    covered_m.insert(covered_m.end(), o.covered_m.begin(), o.covered_m.end());
    tools_m.push_back(o.target_offset_m);
  }

  return ValidityVolume::hull_of(covered_m).and_then([&](ValidityVolume validity) {
    return model_of(runs.front(), tools_m, a.U, a.covariance, std::move(validity));
  });
}

/// Finds the misfit in the residuals of all runs together.
std::optional<FoundMisfit> misfit_of_runs(std::span<const Observations> runs,
                                          std::span<const Residuals> residuals,
                                          const Statistics& statistics,
                                          const Eigen::MatrixXd& of_noise,
                                          const Eigen::MatrixXd& Q) {
  const RunUnknowns unknowns(runs);
  std::vector<ResidualsOfRun> all;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    all.push_back({runs[k], residuals[k].after_m, unknowns.of_run(k),
                   statistics.correlation * segment_distance(runs[k])});
  }
  return find_misfit(all, of_noise, Q);
}

Result<Adjustment> adjust_runs(std::span<const Observations> runs, const Options& options) {
  const estimation::Information rows = rows_information(runs);
  Result<Adjustment> a = datum_of_runs(runs.front().basis, rows.unknowns())
                             .solve(with_priors(rows, runs.front()), datum_options(runs, options));
  if (a && runs.front().smoothness) {
    a->rank = determined_by(rows, a->cofactor_Q);
  }
  return a;
}

/// Result of an adjustment of the rows, with the offsets of the ranges and the drift of the tracker
/// as additional unknowns.
struct FitOfRuns {
  Eigen::VectorXd U;
  std::vector<RangeOffset> offset;                 ///< by run; 0 if the offset has no prior
  std::vector<std::optional<TrackerDrift>> drift;  ///< by run
  Eigen::MatrixXd added_covariance;  ///< covariance of U that is caused by range offsets and drifts
  std::vector<Residuals> residuals;  ///< after subtraction of offset and drift, as all statistics
  std::vector<Statistics> of_runs;
  Statistics all;
};

void add_drift(FitOfRuns& fit, DriftOfRuns found) {
  fit.offset = std::move(found.offset);
  fit.drift = std::move(found.drift);
  fit.U = std::move(found.U);
  fit.added_covariance = std::move(found.added_covariance);
  for (std::size_t k = 0; k < fit.residuals.size(); ++k) {
    fit.residuals[k].after_m = std::move(found.residual_m[k]);
  }
}

void add_offsets(FitOfRuns& fit, std::span<const Observations> runs, const Adjustment& a) {
  const AddedColumns::Estimate e =
      estimate_offsets(runs, a, fit.residuals, fit.all.variance_factor);
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    fit.offset[k] = {e.d(i), e.u(i)};
  }
  fit.U -= e.dU;
  fit.added_covariance = e.root_cov_dU * e.root_cov_dU.transpose();
  subtract_offsets(fit.residuals, runs, fit.U, fit.offset);
}

Result<FitOfRuns> fit_of_runs(std::span<const Observations> runs, const Adjustment& a,
                              const Options& options) {
  const std::size_t unknowns = RunUnknowns(runs).size();
  FitOfRuns fit{.U = a.U,
                .offset = std::vector<RangeOffset>(runs.size()),
                .drift = std::vector<std::optional<TrackerDrift>>(runs.size()),
                .added_covariance = Eigen::MatrixXd::Zero(a.U.size(), a.U.size()),
                .residuals = residuals_of_runs(runs, a.U)};
  const auto set_figures = [&] {
    fit.of_runs = statistics_of_runs(runs, a, fit.residuals);
    fit.all = statistics_of_all(fit.of_runs, a, unknowns);
  };
  set_figures();

  if (any_drift(runs)) {
    std::vector<std::vector<double>> residual_m;
    for (const Residuals& r : fit.residuals) {
      residual_m.push_back(r.after_m);
    }
    const auto variance = [&](const std::vector<std::vector<double>>& without_m) {
      std::vector<Residuals> residuals = fit.residuals;
      for (std::size_t k = 0; k < residuals.size(); ++k) {
        residuals[k].after_m = without_m[k];
      }
      return statistics_of_all(statistics_of_runs(runs, a, residuals), a, unknowns).variance_factor;
    };
    Result<DriftOfRuns> found = drift_of_runs(runs, a, residual_m, variance, options.stopped);
    ABBE_TRY(found);
    add_drift(fit, *std::move(found));
    set_figures();
  } else if (runs.front().u_range_offset_m > 0.0) {
    add_offsets(fit, runs, a);
    set_figures();
  }
  return fit;
}

/// adjust_runs() with a prior for smooth tables, if one is requested: the prior is left out where
/// the rows of all runs contradict it. For this test the range offsets and the drift from the fit
/// without a prior are subtracted.
Result<Adjustment> adjust_smooth(std::vector<Observations>& runs, const Options& options) {
  Result<Adjustment> a = adjust_runs(runs, options);
  if (!a || !runs.front().smoothness) {
    return a;
  }

  const Result<FitOfRuns> first = fit_of_runs(runs, *a, options);
  ABBE_TRY(first);
  std::vector<Observations> judged = runs;
  for (std::size_t k = 0; k < judged.size(); ++k) {
    judged[k] = without_range_offset(std::move(judged[k]), first->offset[k].value_m);
    if (first->drift[k]) {
      judged[k] = without_drift(std::move(judged[k]), *first->drift[k]);
    }
  }
  const Result<Smoothness> chosen = permitted_smoothness(
      rows_information(judged), runs.front().basis, *options.smoothness, first->all.variance_factor,
      [&](const Smoothness& s) {
        for (Observations& o : runs) {
          o.smoothness = s;
        }
        a = adjust_runs(runs, options);
        return a.and_then([&](const Adjustment& with) {
          return fit_of_runs(runs, with, options).map([](const FitOfRuns& fit) {
            return fit.all.variance_factor;
          });
        });
      });
  ABBE_TRY(chosen);

  const std::vector<std::string> notes = notes_on(*chosen);
  runs.front().notes.insert(runs.front().notes.end(), notes.begin(), notes.end());
  return a;
}

Result<TargetsIdentification> solve_runs(std::vector<Observations> runs, int adjustments,
                                         const Options& options) {
  const RunUnknowns unknowns(runs);
  if (rows_of_runs(runs) <= unknowns.size()) {
    return failure(ErrorCode::TooFewObservations,
                   message("adjustment of ", runs.size(), " runs: ", rows_of_runs(runs),
                           " observations for ", unknowns.size(), " unknowns"));
  }

  Result<Adjustment> a = adjust_smooth(runs, options);
  ABBE_TRY(a);

  const Adjustment of_rows = *a;
  Result<FitOfRuns> found_fit = fit_of_runs(runs, *a, options);
  ABBE_TRY(found_fit);
  FitOfRuns& fit = *found_fit;
  a->U = std::move(fit.U);
  std::optional<FoundMisfit> misfit =
      misfit_of_runs(runs, fit.residuals, fit.all,
                     fit.all.chi2_per_dof * fit.all.correlation * a->covariance, a->cofactor_Q);
  a->covariance *= fit.all.variance_factor;
  a->covariance += fit.added_covariance;
  add_scales_of_runs(a->covariance, runs, a->cofactor_Q);
  fit.all.iterations = adjustments;

  Result<VolumetricModel> model = model_of_runs(runs, *a);
  if (model && misfit) {
    Adjustment with = *a;
    with.covariance += misfit->root_of_covariance * misfit->root_of_covariance.transpose();
    Result<VolumetricModel> other =
        model_of_runs(runs, with).and_then([&](const VolumetricModel& of_tables) {
          return of_tables.with_misfit(misfit->misfit);
        });
    if (!other || is_notable_misfit(*other)) {
      model = std::move(other);
      a = std::move(with);
      runs.front().notes.insert(runs.front().notes.end(), misfit->notes.begin(),
                                misfit->notes.end());
    }
  }
  ABBE_TRY(model);

  const Estimator estimator =
      options.mode == Mode::OnTheFly ? options.estimator : Estimator::TwoStep;
  TargetsIdentification found{.observations = {}, .solutions = {}, .statistics = fit.all};
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const auto rigid = static_cast<Eigen::Index>(unknowns.rigid_offset(k));
    found.solutions.push_back({.estimator = estimator,
                               .model = *model,
                               .rigid = a->U.segment<kRigidUnknowns>(rigid),
                               .covariance_with_rigid = unknowns.block(a->covariance, k),
                               .adjustment = adjustment_of_run(of_rows, runs, k),
                               .T_machine_tracker = runs[k].alignment.T_machine_tracker,
                               .statistics = fit.of_runs[k],
                               .residuals = std::move(fit.residuals[k]),
                               .range_offset = fit.offset[k],
                               .backlash = backlash_of(runs[k], a->U, a->covariance),
                               .drift = std::move(fit.drift[k]),
                               .smoothness = runs[k].smoothness});
  }
  found.observations = std::move(runs);
  return found;
}

}  // namespace

Result<TargetsIdentification> identify_targets(std::span<const TargetRun> runs,
                                               const Machine& machine, const Noise& noise,
                                               const Options& options) {
  ABBE_TRY(check_targets(runs));
  if (options.encoders != nullptr) {
    return failure(
        ErrorCode::BadInput,
        "several targets: scale readings (Options::encoders) belong to one run; identify "
        "the runs without them");
  }

  Result<ObservedRuns> observed = observe_runs(runs, machine, noise, options);
  ABBE_TRY(observed);

  int adjustments = 1;
  if (options.estimator == Estimator::Simultaneous && options.mode == Mode::OnTheFly) {
    const Result<int> linearised = linearise_runs(*observed, noise, options);
    ABBE_TRY(linearised);
    adjustments = *linearised;
  }

  return solve_runs(std::move(observed->observations), adjustments, options);
}

}  // namespace abbe::calib::otf

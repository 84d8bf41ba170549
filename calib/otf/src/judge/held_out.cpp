#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>
#include <optional>
#include <utility>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/otf/judge/held_out_rows.hpp"
#include "abbe/calib/otf/judge/judge.hpp"
#include "abbe/result/try.hpp"
#include "judge/drift_held_out.hpp"
#include "run/progress.hpp"
#include "solve/priors.hpp"
#include "solve/run_unknowns.hpp"

namespace abbe::calib::otf {
namespace {

double predicted_by_fit(const Observations& o, std::size_t row, const Eigen::VectorXd& U) {
  double sum = 0.0;
  for (const SparseRows::Entry& e : o.A.row(row)) {
    sum += e.value * U(static_cast<Eigen::Index>(e.column));
  }
  return sum;
}

std::vector<RowInformation> information_by_fold(const Observations& o, std::size_t folds) {
  std::vector<RowInformation> parts;
  for (std::size_t f = 0; f < folds; ++f) {
    parts.push_back(information_of(o, [&](const Observation& r) { return r.leg % folds == f; }));
  }
  return parts;
}

/// A run with the information of each of its folds.
struct RunByFold {
  const Observations& o;
  std::vector<RowInformation> parts;
  std::optional<Observations> with_linear;  ///< nullopt if the tables of `o` are linear
  std::optional<DriftHeldOut> drift{};      ///< nullopt if no drift was removed from `o`

  RunByFold(const Observations& run, std::size_t folds, const Solution* solution)
      : o(run), parts(information_by_fold(run, folds)) {
    if (solution != nullptr && solution->drift && run.drift) {
      drift.emplace(run, *solution->drift);
    }
    if (!has_linear_tables(run.basis)) {
      with_linear = with_linear_tables(run);
    }
  }
  [[nodiscard]] const Observations& linear() const { return with_linear ? *with_linear : o; }
};

struct HeldOutFold {
  Eigen::VectorXd U;
  Eigen::VectorXd change_of_drift{};  ///< coefficients; empty without a drift
  /// for each run the held-out rows, to which U was not fitted
  std::vector<std::vector<std::size_t>> rows;
};

struct FittedFold {
  Eigen::VectorXd U;
  Eigen::VectorXd change_of_drift{};
};

/// Fits all runs without a fold. `first`: the first run. The drift is estimated again without the
/// held-out legs only if there is a single run; with several runs the removed drift is that of all
/// legs. `training`: information of the rows for which `take` returns true.
Result<FittedFold> fit_fold(const RunByFold& first, const estimation::Information& training,
                            std::size_t unknowns,
                            const std::function<bool(const Observation&)>& take,
                            const Options& options) {
  const estimation::Datum datum = datum_of_runs(first.o.basis, unknowns);
  if (!first.drift) {
    return datum.estimate(training, {.weight = options.datum_weight}).map([](Eigen::VectorXd U) {
      return FittedFold{std::move(U)};
    });
  }

  const Result<Adjustment> a = datum.solve(training, {.weight = options.datum_weight});
  ABBE_TRY(a);
  FittedFold fitted{a->U};
  Result<Eigen::VectorXd> change = first.drift->correct(fitted.U, *a, take, options.stopped);
  ABBE_TRY(change);
  fitted.change_of_drift = *std::move(change);
  return fitted;
}

/// Estimates the unknowns without the legs of one fold. A leg of the fold stays in the fit if it
/// alone observes a node of a table in its run. If the rank is too small even so, the result has no
/// held-out rows.
Result<HeldOutFold> hold_out(const std::vector<RunByFold>& runs, std::size_t fold,
                             std::size_t folds, const Options& options) {
  const RunUnknowns unknowns(runs.front().o, runs.size());
  estimation::Information training(unknowns.size());
  std::vector<std::vector<bool>> needed;

  for (std::size_t k = 0; k < runs.size(); ++k) {
    const std::vector<std::size_t> at = unknowns.of_run(k);
    for (std::size_t f = 0; f < folds; ++f) {
      if (f != fold) {
        training.add(runs[k].parts[f].data, at);
      }
    }
    const std::vector<bool>& legs = needed.emplace_back(legs_needed(runs[k].linear(), fold, folds));
    if (std::find(legs.begin(), legs.end(), true) != legs.end()) {
      training.add(
          information_of(runs[k].o, [&](const Observation& r) { return legs[r.leg]; }).data, at);
    }
  }

  const Observations& any = runs.front().o;
  Result<FittedFold> fitted = fit_fold(
      runs.front(), with_priors(std::move(training), any), unknowns.size(),
      [&](const Observation& r) { return r.leg % folds != fold || needed[0][r.leg]; }, options);
  if (!fitted && fitted.error().code == ErrorCode::RankDeficient) {
    return HeldOutFold{};
  }
  if (!fitted) {
    return failure(fitted.error().code, message("held-out test without fold ", fold, " of ", folds,
                                                ": ", fitted.error().text));
  }

  // The model is the mean of both directions of travel: it does not predict backlash.
  const auto model = static_cast<Eigen::Index>(any.layout().model_size());
  fitted->U.segment(model, static_cast<Eigen::Index>(any.basis.size()) - model).setZero();
  HeldOutFold held{std::move(fitted->U), std::move(fitted->change_of_drift),
                   std::vector<std::vector<std::size_t>>(runs.size())};
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const std::vector<Observation>& rows = runs[k].o.rows;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (rows[i].leg % folds == fold && !needed[k][rows[i].leg]) {
        held.rows[k].push_back(i);
      }
    }
  }

  return held;
}

}  // namespace

Result<HeldOutFigures> held_out(const Observations& o, const VolumetricModel* active,
                                const Options& options) {
  return held_out(std::span(&o, 1), active, options);
}

Result<HeldOutFigures> held_out(std::span<const Observations> observed,
                                const VolumetricModel* active, const Options& options,
                                const HeldOutRow& row, std::span<const Solution> solutions) {
  const std::size_t folds = options.held_out_folds;
  std::vector<RunByFold> runs;
  std::size_t all_rows = 0;
  for (const Observations& o : observed) {
    const std::size_t legs = o.rows.empty() ? 0 : o.rows.back().leg + 1;
    if (folds < 2 || legs < folds) {
      return failure(ErrorCode::TooFewObservations,
                     message("held-out test: ", legs, " legs in ", folds,
                             " folds, needs at least 2 folds and one leg per fold"));
    }
    runs.emplace_back(o, folds, solutions.size() == 1 ? &solutions.front() : nullptr);
    all_rows += o.rows.size();
  }

  const RunUnknowns unknowns(observed);
  HeldOutSums sums;

  for (std::size_t f = 0; f < folds; ++f) {
    ABBE_TRY(check_stopped(options.stopped));
    const Result<HeldOutFold> fit = hold_out(runs, f, folds, options);
    ABBE_TRY(fit);
    for (std::size_t k = 0; k < fit->rows.size(); ++k) {
      const Observations& o = observed[k];
      const Eigen::VectorXd U = unknowns.part(fit->U, k);
      const auto of_run = [&](std::size_t i, double no_compensation_m, double candidate_m) {
        if (row) {
          row(k, i, no_compensation_m, candidate_m);
        }
      };
      sums.add(
          o, fit->rows[k], [&](std::size_t i) { return predicted_by_fit(o, i, U); }, active, of_run,
          [&](std::size_t i) {
            return runs[k].drift ? runs[k].drift->effect_m(i, fit->change_of_drift) : 0.0;
          });
    }
    report(options, Stage::Judge, static_cast<double>(f + 1) / static_cast<double>(folds));
  }

  if (sums.none.rows == 0) {
    return failure(
        ErrorCode::RankDeficient,
        message("held-out test: without any one of ", folds,
                " folds the other legs do not determine the model; measure every part of the "
                "volume on more legs"));
  }

  return sums.figures(all_rows);
}

}  // namespace abbe::calib::otf

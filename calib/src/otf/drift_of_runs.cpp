#include "otf/drift_of_runs.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "otf/drift_columns.hpp"
#include "otf/drift_estimate.hpp"
#include "otf/row_residuals.hpp"
#include "otf/run_unknowns.hpp"
#include "otf/with_drift.hpp"

namespace abbe::calib::otf {
namespace {

using Columns = std::vector<std::size_t>;

/// The added unknowns of all runs: the range offset if it has a prior, then the drift of each run
/// that has one.
class DriftUnknowns {
 public:
  explicit DriftUnknowns(std::span<const Observations> runs) {
    const std::size_t offsets = runs.front().u_range_offset_m > 0.0 ? 1 : 0;
    size_ = offsets;
    for (const Observations& o : runs) {
      Columns& own = of_run_.emplace_back();
      for (std::size_t i = 0; o.drift && i < DriftBasis(*o.drift).size(); ++i) {
        own.push_back(size_++);
      }
      Columns& seen = seen_by_.emplace_back();
      for (std::size_t i = 0; i < offsets; ++i) {
        seen.push_back(i);
      }
      seen.insert(seen.end(), own.begin(), own.end());
    }
  }

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t offsets() const { return size_ > 0 && has_offset() ? 1 : 0; }
  [[nodiscard]] const Columns& of_run(std::size_t run) const { return of_run_[run]; }
  /// The range offset and the drift of a run: the columns of its rows.
  [[nodiscard]] const Columns& seen_by(std::size_t run) const { return seen_by_[run]; }
  [[nodiscard]] Columns others(std::size_t run) const {
    Columns out;
    for (std::size_t i = 0; i < size_; ++i) {
      if (std::find(of_run_[run].begin(), of_run_[run].end(), i) == of_run_[run].end()) {
        out.push_back(i);
      }
    }
    return out;
  }

 private:
  [[nodiscard]] bool has_offset() const { return seen_by_.front().size() > of_run_.front().size(); }

  std::size_t size_ = 0;
  std::vector<Columns> of_run_, seen_by_;
};

/// Sums of the columns of one run for its own unknowns.
AddedColumns sums_of_run(const Observations& o, std::span<const double> residual_m,
                         std::size_t offsets, DriftColumns::BetweenKnots between) {
  if (o.drift) {
    return DriftColumns(o, offsets, between).sums(WhitenedRows(o), residual_m);
  }
  AddedColumns sums(offsets, o.unknowns());
  for (std::size_t i = 0; offsets > 0 && i < o.rows.size(); ++i) {
    const double c = drow_drange_offset(o, o.rows[i]);
    sums.add(o.rows[i], o.A.row(i), residual_m[i], std::span(&c, 1));
  }
  return sums;
}

AddedColumns sums_of_runs(std::span<const Observations> runs, const DriftUnknowns& added,
                          const std::vector<std::vector<double>>& residual_m) {
  const RunUnknowns unknowns(runs);
  AddedColumns all(added.size(), unknowns.size());
  for (std::size_t k = 0; k < runs.size(); ++k) {
    all.add(
        sums_of_run(runs[k], residual_m[k], added.offsets(), DriftColumns::BetweenKnots::Straight),
        added.seen_by(k), unknowns.of_run(k));
  }
  return all;
}

/// What visits and priors tell about the added unknowns.
struct OwnInformation {
  Eigen::MatrixXd P;
  Eigen::VectorXd Pc;
};

/// The range offset has its prior, every drift at first one so wide that it tells nothing.
OwnInformation first_information(std::span<const Observations> runs, const DriftUnknowns& added) {
  constexpr double kWide_m = 100e-6;
  const auto n = static_cast<Eigen::Index>(added.size());
  OwnInformation own{Eigen::MatrixXd::Identity(n, n) / (kWide_m * kWide_m),
                     Eigen::VectorXd::Zero(n)};
  if (added.offsets() > 0) {
    const double u_m = runs.front().u_range_offset_m;
    own.P(0, 0) = 1.0 / (u_m * u_m);
  }
  return own;
}

/// Estimates the drift of one run beside the others, and replaces what its visits and its prior tell.
Result<DriftEstimate> estimate_beside(const DriftObservations& d, const Columns& mine,
                                      const Columns& others, const Eigen::MatrixXd& S,
                                      const Eigen::VectorXd& g, OwnInformation& own,
                                      const Stopped& stopped) {
  DriftEquations equations{.S = S(mine, mine), .g = g(mine)};
  if (!others.empty()) {
    const Eigen::LDLT<Eigen::MatrixXd> rest(S(others, others) + own.P(others, others));
    const Eigen::MatrixXd S_or = S(others, mine);
    equations.S -= S_or.transpose() * rest.solve(S_or);
    equations.S = 0.5 * (equations.S + equations.S.transpose()).eval();
    equations.g -= S_or.transpose() * rest.solve(g(others) + own.Pc(others));
  }

  Result<DriftEstimate> e = estimate_drift(d, equations, stopped);
  if (!e) {
    return e;
  }
  constexpr double kResolved_m = 1e-9;  // a drift is smooth: its covariance is nearly singular
  Eigen::MatrixXd V = e->covariance;
  V.diagonal().array() += kResolved_m * kResolved_m;
  const Eigen::LDLT<Eigen::MatrixXd> posterior(V);
  const Eigen::MatrixXd information =
      posterior.solve(Eigen::MatrixXd::Identity(V.rows(), V.cols()));
  own.P(mine, mine) = 0.5 * (information + information.transpose()) - equations.S;
  own.Pc(mine) = posterior.solve(e->d) - equations.g;
  return e;
}

/// What all that is known tells about the added unknowns.
struct AllDrifts {
  Eigen::VectorXd d;
  Eigen::MatrixXd covariance;
  std::vector<std::optional<DriftEstimate>> of_run;
};

Result<AllDrifts> estimate_all(std::span<const Observations> runs, const DriftUnknowns& added,
                               const Eigen::MatrixXd& S, const Eigen::VectorXd& g,
                               const Stopped& stopped) {
  constexpr int kSweeps = 3;
  OwnInformation own = first_information(runs, added);
  AllDrifts all;
  all.of_run.resize(runs.size());
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (std::size_t k = 0; k < runs.size(); ++k) {
      if (!runs[k].drift) {
        continue;
      }
      Result<DriftEstimate> e =
          estimate_beside(*runs[k].drift, added.of_run(k), added.others(k), S, g, own, stopped);
      if (!e) {
        return tl::unexpected(e.error());
      }
      all.of_run[k] = *std::move(e);
    }
  }

  const Eigen::LDLT<Eigen::MatrixXd> known(S + own.P);
  all.d = known.solve(g + own.Pc);
  const Eigen::MatrixXd covariance = known.solve(Eigen::MatrixXd::Identity(S.rows(), S.cols()));
  all.covariance = 0.5 * (covariance + covariance.transpose());
  return all;
}

/// What the course of the drift of a run between its knots adds to the covariance of U
/// (with_drift.cpp), with the drifts of all runs.
Eigen::MatrixXd covariance_between_knots_of(std::span<const Observations> runs, std::size_t run,
                                            const DriftUnknowns& added, const Adjustment& a,
                                            const AddedColumns::Reduced& reduced,
                                            const AddedColumns& sums_of_all,
                                            const std::vector<std::vector<double>>& residual_m,
                                            const AllDrifts& all, double factor) {
  const RunUnknowns unknowns(runs);
  const Observations& o = runs[run];
  const std::size_t between = DriftBasis(*o.drift).between_knots();
  Columns at = added.seen_by(run);
  for (std::size_t i = 0; i < between; ++i) {
    at.push_back(added.size() + i);
  }

  AddedColumns with(added.size() + between, unknowns.size());
  Columns straight;
  for (std::size_t i = 0; i < added.size(); ++i) {
    straight.push_back(i);
  }
  Columns every_unknown;
  for (std::size_t i = 0; i < unknowns.size(); ++i) {
    every_unknown.push_back(i);
  }
  with.add(sums_of_all, straight, every_unknown);
  const AddedColumns own =
      sums_of_run(o, residual_m[run], added.offsets(), DriftColumns::BetweenKnots::Walk);
  const AddedColumns own_straight =
      sums_of_run(o, residual_m[run], added.offsets(), DriftColumns::BetweenKnots::Straight);
  with.add(own, at, unknowns.of_run(run));
  AddedColumns twice(added.size() + between, unknowns.size());
  twice.add(own_straight, added.seen_by(run), unknowns.of_run(run));
  with -= twice;

  const AddedColumns::Reduced both = with.reduced(a.cofactor_Q);
  const auto d = static_cast<Eigen::Index>(added.size()), b = static_cast<Eigen::Index>(between);
  const Eigen::MatrixXd dd_db = all.covariance * both.S.topRightCorner(d, b) / factor;
  const Eigen::MatrixXd dU_db = both.dU_dd.rightCols(b) - reduced.dU_dd * dd_db;
  const double walk_m = all.of_run[run]->walk_m;
  return walk_m * walk_m * (dU_db * dU_db.transpose());
}

std::vector<std::vector<double>> residuals_without_m(std::span<const Observations> runs,
                                                     const DriftUnknowns& added,
                                                     const Eigen::VectorXd& U,
                                                     const Eigen::VectorXd& d) {
  const RunUnknowns unknowns(runs);
  std::vector<std::vector<double>> residual_m;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const Observations& o = runs[k];
    std::vector<double>& r = residual_m.emplace_back(residuals_m(o, unknowns.part(U, k)));
    const Eigen::VectorXd own = d(added.seen_by(k));
    for (std::size_t i = 0; i < r.size(); ++i) {
      if (o.drift) {
        r[i] -= DriftColumns(o, added.offsets()).effect_m(o.rows[i], own);
      } else if (added.offsets() > 0) {
        r[i] -= drow_drange_offset(o, o.rows[i]) * own(0);
      }
    }
  }
  return residual_m;
}

}  // namespace

Result<DriftOfRuns> drift_of_runs(std::span<const Observations> runs, const Adjustment& a,
                                  const std::vector<std::vector<double>>& residual_m,
                                  const VarianceOfRuns& variance, const Stopped& stopped) {
  constexpr int kRounds = 3;
  const DriftUnknowns added(runs);
  const AddedColumns sums = sums_of_runs(runs, added, residual_m);
  const AddedColumns::Reduced reduced = sums.reduced(a.cofactor_Q);

  DriftOfRuns out;
  AllDrifts all;
  double factor = 1.0, factor_used = 1.0;
  for (int round = 0; round < kRounds; ++round) {
    factor_used = factor;
    Result<AllDrifts> found =
        estimate_all(runs, added, reduced.S / factor, reduced.g / factor, stopped);
    if (!found) {
      return tl::unexpected(found.error());
    }
    all = *std::move(found);
    out.U = a.U - reduced.dU_dd * all.d;
    out.residual_m = residuals_without_m(runs, added, out.U, all.d);
    factor = std::max(1.0, variance(out.residual_m));
  }

  if (added.offsets() > 0) {
    out.offset = {all.d(0), std::sqrt(std::max(0.0, all.covariance(0, 0)))};
  }
  Eigen::MatrixXd covariance = reduced.dU_dd * all.covariance * reduced.dU_dd.transpose();
  for (std::size_t k = 0; k < runs.size(); ++k) {
    std::optional<TrackerDrift>& drift = out.drift.emplace_back();
    if (!all.of_run[k]) {
      continue;
    }
    drift = tracker_drift(runs[k], *all.of_run[k], all.d(added.of_run(k)));
    if (notable_walk(*all.of_run[k])) {
      covariance += covariance_between_knots_of(runs, k, added, a, reduced, sums, residual_m, all,
                                                factor_used);
    }
  }
  out.added_covariance = 0.5 * (covariance + covariance.transpose());
  return out;
}

}  // namespace abbe::calib::otf

#include "identify/drift_of_runs.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/otf/observe/row_residuals.hpp"
#include "abbe/result/try.hpp"
#include "nests/drift_estimate.hpp"
#include "solve/drift_columns.hpp"
#include "solve/run_unknowns.hpp"
#include "solve/with_drift.hpp"

namespace abbe::calib::otf {
namespace {

using Columns = std::vector<std::size_t>;

/// The additional unknowns of all runs: the range offset of each run if it has a prior, then the
/// drift of each run that has one.
class DriftUnknowns {
 public:
  explicit DriftUnknowns(std::span<const Observations> runs) {
    offsets_ = runs.front().u_range_offset_m > 0.0 ? 1 : 0;
    size_ = offsets_ * runs.size();
    for (const Observations& o : runs) {
      Columns& own = of_run_.emplace_back();
      for (std::size_t i = 0; o.drift && i < DriftBasis(*o.drift).size(); ++i) {
        own.push_back(size_++);
      }
      Columns& seen = seen_by_.emplace_back();
      if (offsets_ > 0) {
        seen.push_back(seen_by_.size() - 1);
      }
      seen.insert(seen.end(), own.begin(), own.end());
    }
  }

  [[nodiscard]] std::size_t size() const { return size_; }
  /// number of range offsets of each run: 1 or 0
  [[nodiscard]] std::size_t offsets() const { return offsets_; }
  [[nodiscard]] const Columns& of_run(std::size_t run) const { return of_run_[run]; }
  /// Indices of the range offset and the drift of a run: unknowns on which its rows depend.
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
  std::size_t offsets_ = 0;  ///< number of range offsets of each run
  std::size_t size_ = 0;
  std::vector<Columns> of_run_, seen_by_;
};

/// Sums of the additional columns of one run, for its own additional unknowns only.
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

/// Information of visits and priors about the additional unknowns d: matrix P and vector P c.
struct OwnInformation {
  Eigen::MatrixXd P;
  Eigen::VectorXd Pc;
};

/// Start values: each range offset has its prior; every drift has a prior that is so wide that it
/// has almost no information.
OwnInformation first_information(std::span<const Observations> runs, const DriftUnknowns& added) {
  constexpr double kWide_m = 100e-6;
  const auto n = static_cast<Eigen::Index>(added.size());
  OwnInformation own{Eigen::MatrixXd::Identity(n, n) / (kWide_m * kWide_m),
                     Eigen::VectorXd::Zero(n)};
  if (added.offsets() > 0) {
    const double u_m = runs.front().u_range_offset_m;
    own.P.diagonal().head(std::ssize(runs)).setConstant(1.0 / (u_m * u_m));
  }
  return own;
}

/// Estimates the drift of one run, given the information about the others. Then replaces the
/// information of its visits and its prior in `own`.
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
  constexpr double kResolved_m = 1e-9;  // a drift is smooth, so that its covariance is nearly
                                        // singular
  Eigen::MatrixXd V = e->covariance;
  V.diagonal().array() += kResolved_m * kResolved_m;
  const Eigen::LDLT<Eigen::MatrixXd> posterior(V);
  const Eigen::MatrixXd information =
      posterior.solve(Eigen::MatrixXd::Identity(V.rows(), V.cols()));
  own.P(mine, mine) = 0.5 * (information + information.transpose()) - equations.S;
  own.Pc(mine) = posterior.solve(e->d) - equations.g;
  return e;
}

/// Estimate of the additional unknowns from all information.
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
      ABBE_TRY(e);
      all.of_run[k] = *std::move(e);
    }
  }

  const Eigen::LDLT<Eigen::MatrixXd> known(S + own.P);
  if (known.info() != Eigen::Success || !(known.vectorD().array() > 0.0).all()) {
    return failure(ErrorCode::NotConverged,
                   "drift of the tracker in several runs: what the visits of the runs tell "
                   "contradicts itself; identify without [[tracker.nest]], or leave out a run");
  }
  all.d = known.solve(g + own.Pc);
  const Eigen::MatrixXd covariance = known.solve(Eigen::MatrixXd::Identity(S.rows(), S.cols()));
  all.covariance = 0.5 * (covariance + covariance.transpose());
  return all;
}

/// The adjustment of all runs with the additional unknowns.
class AddedToRuns {
 public:
  AddedToRuns(std::span<const Observations> runs, const Adjustment& a,
              const std::vector<std::vector<double>>& residual_m)
      : runs_(runs),
        unknowns_(runs),
        added_(runs),
        a_(a),
        residual_m_(residual_m),
        sums_(sums_with(added_.size())),
        reduced_(sums_.reduced(a.cofactor_Q)) {}

  [[nodiscard]] const DriftUnknowns& added() const { return added_; }
  [[nodiscard]] const AddedColumns::Reduced& reduced() const { return reduced_; }

  /// Residuals of each run: y - A U, after subtraction of the effect of the additional unknowns d.
  [[nodiscard]] std::vector<std::vector<double>> residuals_without_m(
      const Eigen::VectorXd& U, const Eigen::VectorXd& d) const {
    std::vector<std::vector<double>> all;
    for (std::size_t k = 0; k < runs_.size(); ++k) {
      const Observations& o = runs_[k];
      std::vector<double>& r = all.emplace_back(residuals_m(o, unknowns_.part(U, k)));
      const Eigen::VectorXd own = d(added_.seen_by(k));
      for (std::size_t i = 0; i < r.size(); ++i) {
        if (o.drift) {
          r[i] -= DriftColumns(o, added_.offsets()).effect_m(o.rows[i], own);
        } else if (added_.offsets() > 0) {
          r[i] -= drow_drange_offset(o, o.rows[i]) * own(0);
        }
      }
    }
    return all;
  }

  /// Additional covariance of U because the drift of a run is not straight between its knots
  /// (with_drift.cpp). `covariance`: that of the additional unknowns, `factor`: that of the
  /// variance of the rows.
  [[nodiscard]] Eigen::MatrixXd covariance_between_knots(std::size_t run, double walk_m,
                                                         const Eigen::MatrixXd& covariance,
                                                         double factor) const {
    const std::size_t between = DriftBasis(*runs_[run].drift).between_knots();
    AddedColumns sums = sums_with(added_.size() + between, run);
    const AddedColumns::Reduced all = sums.reduced(a_.cofactor_Q);
    const auto d = static_cast<Eigen::Index>(added_.size()), b = static_cast<Eigen::Index>(between);
    const Eigen::MatrixXd dd_db = covariance * all.S.topRightCorner(d, b) / factor;
    const Eigen::MatrixXd dU_db = all.dU_dd.rightCols(b) - all.dU_dd.leftCols(d) * dd_db;
    return walk_m * walk_m * (dU_db * dU_db.transpose());
  }

 private:
  /// Sums of all runs. If `between` is given, the columns between the knots of this run follow the
  /// others.
  [[nodiscard]] AddedColumns sums_with(std::size_t columns,
                                       std::optional<std::size_t> between = {}) const {
    AddedColumns all(columns, unknowns_.size());
    for (std::size_t k = 0; k < runs_.size(); ++k) {
      const bool walks = between == k;
      Columns at = added_.seen_by(k);
      for (std::size_t i = added_.size(); walks && i < columns; ++i) {
        at.push_back(i);
      }
      all.add(sums_of_run(
                  runs_[k], residual_m_[k], added_.offsets(),
                  walks ? DriftColumns::BetweenKnots::Walk : DriftColumns::BetweenKnots::Straight),
              at, unknowns_.of_run(k));
    }
    return all;
  }

  std::span<const Observations> runs_;
  RunUnknowns unknowns_;
  DriftUnknowns added_;
  const Adjustment& a_;
  const std::vector<std::vector<double>>& residual_m_;
  AddedColumns sums_;
  AddedColumns::Reduced reduced_;
};

}  // namespace

Result<DriftOfRuns> drift_of_runs(std::span<const Observations> runs, const Adjustment& a,
                                  const std::vector<std::vector<double>>& residual_m,
                                  const VarianceOfRuns& variance, const Stopped& stopped) {
  constexpr int kRounds = 3;
  const AddedToRuns with(runs, a, residual_m);
  const DriftUnknowns& added = with.added();
  const AddedColumns::Reduced& reduced = with.reduced();

  DriftOfRuns out;
  AllDrifts all;
  double factor = 1.0, factor_used = 1.0;
  for (int round = 0; round < kRounds; ++round) {
    factor_used = factor;
    Result<AllDrifts> found =
        estimate_all(runs, added, reduced.S / factor, reduced.g / factor, stopped);
    ABBE_TRY(found);
    all = *std::move(found);
    out.U = a.U - reduced.dU_dd * all.d;
    out.residual_m = with.residuals_without_m(out.U, all.d);
    factor = std::max(1.0, variance(out.residual_m));
  }

  out.offset.resize(runs.size());
  for (std::size_t k = 0; added.offsets() > 0 && k < runs.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    out.offset[k] = {all.d(i), std::sqrt(std::max(0.0, all.covariance(i, i)))};
  }
  Eigen::MatrixXd covariance = reduced.dU_dd * all.covariance * reduced.dU_dd.transpose();
  for (std::size_t k = 0; k < runs.size(); ++k) {
    std::optional<TrackerDrift>& drift = out.drift.emplace_back();
    const std::optional<DriftEstimate>& estimate = all.of_run[k];
    if (!estimate) {
      continue;
    }
    drift = tracker_drift(runs[k], *estimate, all.d(added.of_run(k)));
    if (notable_walk(*estimate)) {
      covariance += with.covariance_between_knots(k, estimate->walk_m, all.covariance, factor_used);
    }
  }
  out.added_covariance = 0.5 * (covariance + covariance.transpose());
  return out;
}

}  // namespace abbe::calib::otf

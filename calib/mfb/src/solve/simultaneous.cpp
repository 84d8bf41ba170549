#include "abbe/calib/internal/mfb/solve/simultaneous.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/estimation/null_space.hpp"
#include "abbe/calib/internal/statistics/quantile_999.hpp"
#include "abbe/result/try.hpp"
#include "solve/budget.hpp"
#include "solve/residuals.hpp"
#include "solve/triangle.hpp"

namespace abbe::calib::mfb {
namespace {

/// Combinations of column-scaled unknowns below this value are undetermined (rounding of 300 rows).
constexpr double kUndetermined = 1e-11;

Eigen::VectorXd column_lengths(const RowMajorRows& R) {
  return R.colwise().norm().transpose().cwiseMax(1e-300);
}

double least_diagonal(const RowMajorRows& R, const Eigen::VectorXd& lengths) {
  return R.diagonal().cwiseAbs().cwiseQuotient(lengths).minCoeff();
}

/// Trace of the hat matrix; the degrees of freedom are the observations minus this trace. An
/// unknown with a prior of standard uncertainty u, and u' after the adjustment, counts as 1 -
/// (u'/u)^2.
double trace_of_hat_matrix(const WholeSystem& system, const SharedEstimate& estimate) {
  double trace = static_cast<double>(system.shared.size());
  for (Eigen::Index k = system.shared.bar_offset(); k < system.shared.size(); ++k) {
    trace -= estimate.covariance(k, k);
  }
  for (const PositionSystem& s : system.positions) {
    trace += static_cast<double>(s.layout.size);
    for (Eigen::Index k = 0; k < s.layout.size; ++k) {
      if (const double u = s.layout.u[static_cast<std::size_t>(k)]; std::isfinite(u)) {
        const double posterior = nuisance_uncertainty(s, estimate, k);
        trace -= posterior * posterior / (u * u);
      }
    }
  }
  return trace - static_cast<double>(estimate.defect);
}

std::size_t priors_of(const WholeSystem& system) {
  auto priors = static_cast<std::size_t>(system.shared.size() - system.shared.bar_offset());
  for (const PositionSystem& s : system.positions) {
    priors += static_cast<std::size_t>(std::count_if(s.layout.u.begin(), s.layout.u.end(),
                                                     [](double u) { return std::isfinite(u); }));
  }
  return priors;
}

void set_statistics(Solution& solution, const WholeSystem& system, const SharedEstimate& estimate) {
  Statistics& s = solution.statistics;
  s.unknowns = static_cast<std::size_t>(system.shared.size());
  for (const PositionSystem& position : system.positions) {
    s.observations += static_cast<std::size_t>(position.y.size());
    s.unknowns += static_cast<std::size_t>(position.layout.size);
  }
  s.rank = s.unknowns - estimate.defect;
  s.condition = estimate.condition;
  for (const PassResiduals& pass : solution.residuals) {
    s.chi2 += pass.chi2;
  }
  s.degrees_of_freedom =
      static_cast<double>(s.observations) - trace_of_hat_matrix(system, estimate);

  if (s.degrees_of_freedom > 0.0) {
    s.chi2_per_dof = s.chi2 / s.degrees_of_freedom;
    s.chi2_per_dof_limit = chi2_per_dof_999(s.degrees_of_freedom);
  }
  s.sigma0 = std::sqrt(s.chi2_per_dof);
  const double of_all =
      static_cast<double>(s.observations + priors_of(system)) - static_cast<double>(s.rank);
  if (of_all > 0.0) {
    s.all_chi2_per_dof = estimate.rest / of_all;
    s.all_chi2_per_dof_limit = chi2_per_dof_999(of_all);
  }
}

}  // namespace

Result<WholeSystem> whole_system(const Observations& o, const NuisanceOptions& options) {
  WholeSystem system{nominal_touches(o.bar.pattern, o.plan.tip_radius_m), SharedUnknowns(o), {}};
  for (std::size_t i = 0; i < o.positions.size(); ++i) {
    Result<PositionSystem> position = position_system(o, i, system.shared, options);
    ABBE_TRY(position);
    system.positions.push_back(*std::move(position));
  }
  return system;
}

estimation::Information information_of(const WholeSystem& system) {
  estimation::Information data(static_cast<std::size_t>(system.shared.size()));
  add_shared_priors(data, system.shared);
  for (const PositionSystem& position : system.positions) {
    data.add_rows(position.E, position.e);
  }
  return data;
}

SharedEstimate estimate_of(estimation::Information data, const SharedUnknowns& shared) {
  SharedEstimate estimate;
  estimate.rest = data.rest();
  RowMajorRows R = data.R();
  if (!(least_diagonal(R, column_lengths(R)) > kUndetermined)) {
    estimate.defect = data.unknowns() - estimation::pivoted_rank(data);
    for (Eigen::Index k = 0; k < shared.parameters(); ++k) {
      data.add_prior(static_cast<std::size_t>(k), 0.0, 1.0);
    }
    R = data.R();
  }

  estimate.root = inverse_of_upper(R);
  const RowMajorRows& X = estimate.root;
  const Eigen::VectorXd lengths = column_lengths(R);
  estimate.x = X * data.z();
  estimate.covariance = upper_times_transpose(X);
  estimate.condition = largest_singular_value(R * lengths.cwiseInverse().asDiagonal()) *
                       largest_singular_value(lengths.asDiagonal() * X);
  return estimate;
}

SharedEstimate estimate_of(const WholeSystem& system) {
  return estimate_of(information_of(system), system.shared);
}

NuisanceOptions nuisance_options(const SolveOptions& options) {
  return {.u_roll_rad = options.u_roll_rad};
}

Result<Statistics> whole_statistics(const Observations& o, const NuisanceOptions& options) {
  return whole_system(o, options).map([&](const WholeSystem& system) {
    const SharedEstimate estimate = estimate_of(system);
    Solution solution;
    set_residuals(solution, o, system, estimate);
    set_statistics(solution, system, estimate);
    return solution.statistics;
  });
}

Result<double> whole_chi2(const Observations& o, const NuisanceOptions& options) {
  return whole_system(o, options).map([](const WholeSystem& system) {
    return information_of(system).rest();
  });
}

Result<Solution> solve_simultaneously(const Observations& o, const NuisanceOptions& options) {
  const Result<WholeSystem> system = whole_system(o, options);
  ABBE_TRY(system);
  const SharedEstimate estimate = estimate_of(*system);
  const SharedUnknowns& shared = system->shared;

  Solution solution;
  solution.U = shared.expanded(estimate.x.head(shared.parameters()));
  const Eigen::MatrixXd half =
      shared.expanded(estimate.covariance.topLeftCorner(shared.parameters(), shared.parameters()));
  solution.covariance = shared.expanded(half.transpose());
  solution.bar_correction_m =
      shared.bar_root() * estimate.x.segment(shared.bar_offset(), shared.bar_root().cols());
  if (shared.alphas() > 0) {
    solution.alpha_correction_per_K = estimate.x(shared.alpha_offset()) * shared.u_alpha_per_K();
  }
  set_residuals(solution, o, *system, estimate);
  set_degrees_of_freedom(solution, *system, estimate);
  set_statistics(solution, *system, estimate);
  solution.budget = budget_of(o, *system, estimate, options);
  return solution;
}

}  // namespace abbe::calib::mfb

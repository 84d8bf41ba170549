#include "solve/sequential.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/mfb/solve/simultaneous.hpp"
#include "abbe/calib/internal/statistics/quantile_999.hpp"
#include "abbe/result/try.hpp"
#include "solve/residuals.hpp"
#include "solve/sequence.hpp"

namespace abbe::calib::mfb {
namespace {

Result<Sequence> finished_sequence(const Observations& o) {
  if (o.basis.layout().chain().order_w_to_t() != kAllAxes) {
    return failure(ErrorCode::NotApplicable,
                   message("sequential estimator: the chain ", o.basis.layout().chain().text(),
                           " has another order than X, Y, Z from workpiece to tool"));
  }
  std::vector<Profile> profiles = profiles_of(o);
  return roles_of(profiles).and_then([&](SequentialRoles roles) -> Result<Sequence> {
    Sequence sequence(o, std::move(profiles), std::move(roles));
    ABBE_TRY(sequence.run());
    return sequence;
  });
}

/// Effects on U of independent errors with unit variance, one column each.
Result<Eigen::MatrixXd> root_of_result(const Observations& o, const Sequence& sequence,
                                       const SharedUnknowns& shared) {
  const Eigen::Index rows = 3 * std::ssize(o.bar.O_m);
  const Eigen::Index n = sequence.U().rows(), bar = shared.bar_root().cols();
  const Eigen::Index positions = std::ssize(o.positions);
  Eigen::MatrixXd of_noise(n, rows * std::ssize(sequence.profiles()));
  Eigen::MatrixXd of_others = Eigen::MatrixXd::Zero(n, bar + 2 + positions);

  for (std::size_t m = 0; m < sequence.profiles().size(); ++m) {
    const Profile& p = sequence.profiles()[m];
    const PassObservation& pass = o.passes[p.passes.front()];
    const Eigen::Index first = rows * static_cast<Eigen::Index>(m);
    const auto root = root_of_noise(o.plan.noise, pass);
    ABBE_TRY(root);
    const Eigen::MatrixXd S = sequence.U().middleCols(1 + first, rows);
    of_noise.middleCols(first, rows) =
        S * Eigen::MatrixXd(root->matrixL()) / std::sqrt(static_cast<double>(p.passes.size()));

    of_others.leftCols(bar) += S * shared.bar_root();
    const Eigen::Map<const Eigen::VectorXd> O(o.bar.O_m.front().data(), rows);
    const double alpha_per_K = o.bar.expansion ? o.bar.expansion->alpha_per_K : 0.0;
    of_others.col(bar) +=
        (pass.temperature_K - kReferenceTemperature_K) * shared.u_alpha_per_K() * (S * O);
    of_others.col(bar + 1) += shared.growth_of_temperature() * (S * O);
    of_others.col(bar + 2 + static_cast<Eigen::Index>(pass.position)) +=
        alpha_per_K * o.plan.noise.u_temperature_K * (S * O);
  }

  Eigen::MatrixXd all(n, of_noise.cols() + of_others.cols());
  all << of_noise, of_others;
  return all;
}

/// Sets residuals and poses for the tables found; every position gets its best-fit pose.
Result<void> set_residuals_of_sequence(Solution& solution, const Observations& o,
                                       const SolveOptions& options) {
  const Result<WholeSystem> system = whole_system(o, nuisance_options(options));
  ABBE_TRY(system);
  SharedEstimate estimate;
  estimate.x = Eigen::VectorXd::Zero(system->shared.size());
  estimate.x.head(system->shared.parameters()) = system->shared.free_of(solution.U);
  estimate.covariance = Eigen::MatrixXd::Zero(estimate.x.size(), estimate.x.size());
  set_residuals(solution, o, *system, estimate);

  Statistics& s = solution.statistics;
  s.unknowns = static_cast<std::size_t>(system->shared.parameters());
  for (const PositionSystem& position : system->positions) {
    s.observations += static_cast<std::size_t>(position.y.size());
    s.unknowns += static_cast<std::size_t>(position.layout.size);
  }
  s.rank = s.unknowns;
  s.condition = estimate_of(*system).condition;
  s.degrees_of_freedom = static_cast<double>(s.observations) - static_cast<double>(s.unknowns);
  for (PassResiduals& pass : solution.residuals) {
    s.chi2 += pass.chi2;
    pass.degrees_of_freedom = s.degrees_of_freedom / static_cast<double>(o.passes.size());
  }
  s.chi2_per_dof = s.chi2 / s.degrees_of_freedom;
  s.sigma0 = std::sqrt(s.chi2_per_dof);
  s.chi2_per_dof_limit = chi2_per_dof_999(s.degrees_of_freedom);
  return {};
}

}  // namespace

Result<Solution> solve_sequential(const Observations& o, const SolveOptions& options) {
  return finished_sequence(o).and_then([&](const Sequence& sequence) -> Result<Solution> {
    Solution solution;
    const Result<Eigen::MatrixXd> root = root_of_result(o, sequence, SharedUnknowns(o));
    ABBE_TRY(root);
    solution.U = sequence.U().col(0);
    solution.covariance = *root * root->transpose();
    solution.bar_correction_m = Eigen::VectorXd::Zero(3 * std::ssize(o.bar.O_m));
    ABBE_TRY(set_residuals_of_sequence(solution, o, options));
    return solution;
  });
}

Result<std::vector<Eigen::MatrixXd>> sequential_derivatives(const Observations& o) {
  return finished_sequence(o).map([&](const Sequence& sequence) {
    const Eigen::Index rows = 3 * std::ssize(o.bar.O_m);
    std::vector<Eigen::MatrixXd> of_pass(o.passes.size());
    for (std::size_t m = 0; m < sequence.profiles().size(); ++m) {
      const Profile& p = sequence.profiles()[m];
      for (const std::size_t pass : p.passes) {
        of_pass[pass] = sequence.U().middleCols(1 + rows * static_cast<Eigen::Index>(m), rows) /
                        static_cast<double>(p.passes.size());
      }
    }
    return of_pass;
  });
}

}  // namespace abbe::calib::mfb

#include "solve/budget.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "solve/residuals.hpp"

namespace abbe::calib::mfb {
namespace {

/// Variances of all parameters of the model, separated by source.
struct VarianceParts {
  Eigen::VectorXd total, bar, expansion, temperature, roll, drift;
};

/// For all parameters: sum of the squares of the expanded columns.
Eigen::VectorXd squares_of(const SharedUnknowns& shared, const Eigen::MatrixXd& columns) {
  return shared.expanded(columns.topRows(shared.parameters())).rowwise().squaredNorm();
}

Eigen::VectorXd variance_of(const SharedUnknowns& shared, const SharedEstimate& estimate) {
  const Eigen::Index n = shared.parameters();
  const Eigen::MatrixXd half = shared.expanded(estimate.covariance.topLeftCorner(n, n));
  return shared.expanded(half.transpose()).diagonal();
}

VarianceParts variance_parts(const WholeSystem& system, const SharedEstimate& estimate) {
  const SharedUnknowns& shared = system.shared;
  VarianceParts parts;
  parts.total = variance_of(shared, estimate);
  parts.bar = squares_of(
      shared, estimate.covariance.middleCols(shared.bar_offset(), shared.bar_root().cols()));
  parts.expansion =
      squares_of(shared, estimate.covariance.middleCols(shared.alpha_offset(), shared.alphas()));
  parts.temperature = squares_of(
      shared, estimate.covariance.middleCols(shared.temperature_offset(), shared.temperatures()));
  parts.roll = parts.drift = Eigen::VectorXd::Zero(parts.total.size());
  for (const PositionSystem& s : system.positions) {
    parts.roll += squares_of(
        shared, covariance_with_nuisance(s, estimate, kRollUnknown) / s.layout.u[kRollUnknown]);
    if (s.layout.has_temperature()) {
      parts.temperature += squares_of(
          shared, covariance_with_nuisance(s, estimate, s.layout.temperature) / s.layout.u.back());
    }
  }
  return parts;
}

/// Sets the variance that is caused by estimating the drift; zero without pairs.
void set_drift(VarianceParts& parts, const Observations& o, const WholeSystem& system,
               NuisanceOptions options) {
  const bool pairs = std::any_of(o.passes.begin(), o.passes.end(),
                                 [](const PassObservation& p) { return p.pair.has_value(); });
  if (!pairs || !options.drift) {
    return;
  }
  options.drift = false;
  if (const Result<WholeSystem> without = whole_system(o, options)) {
    parts.drift = (parts.total - variance_of(system.shared, estimate_of(*without))).cwiseMax(0.0);
  }
}

Budget largest_of(std::string name, const VarianceParts& parts, Eigen::Index first,
                  Eigen::Index count, const TouchNoise& noise) {
  const auto most = [&](const Eigen::VectorXd& variance) {
    return std::sqrt(std::max(0.0, variance.segment(first, count).maxCoeff()));
  };
  const Eigen::VectorXd touches =
      parts.total - parts.bar - parts.expansion - parts.temperature - parts.roll;
  const double probe = noise.probe_m, machine = noise.machine_m;
  const double of_touch = most(touches) / root_sum_of_squares(probe, machine);
  return {.name = std::move(name),
          .u = most(parts.total),
          .probe = of_touch * probe,
          .machine = of_touch * machine,
          .bar = most(parts.bar),
          .expansion = most(parts.expansion),
          .temperature = most(parts.temperature),
          .roll = most(parts.roll),
          .drift = most(parts.drift)};
}

}  // namespace

std::vector<Budget> budget_of(const Observations& o, const WholeSystem& system,
                              const SharedEstimate& estimate, const NuisanceOptions& options) {
  VarianceParts parts = variance_parts(system, estimate);
  set_drift(parts, o, system, options);

  std::vector<Budget> budget;
  const ParameterLayout& layout = o.basis.layout();
  for (const Table& table : layout.tables()) {
    budget.push_back(
        largest_of(calib::name(table.motion), parts, static_cast<Eigen::Index>(table.offset),
                   static_cast<Eigen::Index>(layout.node_count(table.motion.axis)), o.plan.noise));
  }
  auto parameter = static_cast<Eigen::Index>(layout.squareness_offset());
  for (const std::string_view squareness : kSquarenessNames) {
    budget.push_back(largest_of(std::string(squareness), parts, parameter++, 1, o.plan.noise));
  }
  return budget;
}

}  // namespace abbe::calib::mfb

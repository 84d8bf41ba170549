#include "abbe/calib/otf/judge/lack_of_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/internal/geometry/rigid_free_norm.hpp"
#include "abbe/calib/internal/model/misfit_in_V.hpp"
#include "abbe/calib/internal/otf/observe/row_residuals.hpp"
#include "abbe/calib/internal/statistics/chi2_bound.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "abbe/result/try.hpp"
#include "judge/alternative_columns.hpp"
#include "run/sparse_grid.hpp"
#include "solve/added_columns.hpp"

namespace abbe::calib::otf {
namespace {

/// Probability of a false alarm in a run without a fault, over all alternatives together.
constexpr double kFalseAlarm = 1e-4;
constexpr double kCauses = 10.0;
/// Other design matrices are tested only above this variance factor, because each test takes the
/// time of an adjustment.
constexpr double kSuspicious = 2.0;
constexpr std::size_t kGridCells = 8;  // per axis, of the places at which V is compared

/// Norm for the parameters U of tables, evaluated at some nodes: there, linear and cubic
/// tables have the same V.
RigidFreeNorm rigid_free_norm(const ParameterLayout& layout, const Vector3& t) {
  const std::vector<Vector3> at = sparse_grid(layout.nodes(), kGridCells);
  Eigen::MatrixXd D =
      Eigen::MatrixXd::Zero(3 * std::ssize(at), static_cast<Eigen::Index>(layout.model_size()));
  std::vector<Vector3> points;

  for (Eigen::Index i = 0; i < std::ssize(at); ++i) {
    const Vector3& q = at[static_cast<std::size_t>(i)];
    const DesignColumns columns = design_columns(layout, q, t);
    for (const Column& c : columns.span()) {
      D.block<3, 1>(3 * i, static_cast<Eigen::Index>(c.parameter)) = c.dV_dU;
    }
    points.emplace_back(q + t);
  }

  return {D, points};
}

/// The fit of the model, and the data needed to compare alternatives with it.
struct Fit {
  const Observations& o;
  const std::vector<double>& residual_m;
  const Adjustment& adjustment;
  ResidualNoise noise;
  std::size_t degrees_of_freedom = 0;
  double chi2 = 0.0;
  RigidFreeNorm norm;
  double u_white_m = 0.0;

  /// Excess of chi2 over its value for the noise between neighbouring segments.
  [[nodiscard]] double excess() const {
    return chi2 - static_cast<double>(degrees_of_freedom) * noise.local * noise.local;
  }
};

Fit fit_of(const Observations& o, const Solution& solution) {
  const std::size_t dof = solution.statistics.degrees_of_freedom;
  Fit fit{.o = o,
          .residual_m = solution.residuals.after_m,
          .adjustment = solution.adjustment,
          .noise = residual_noise(o, solution.residuals.after_m, dof),
          .degrees_of_freedom = dof,
          .chi2 = solution.statistics.chi2,
          .norm = rigid_free_norm(o.layout(), o.target_offset_m)};
  fit.u_white_m = fit.norm.rms_u_m(fit.adjustment.covariance);

  return fit;
}

/// Residuals of the model that includes the alternative.
std::vector<double> residuals_with(const Fit& fit, const AlternativeColumns& columns,
                                   const Added& added, const AddedColumns::Estimate& e) {
  std::vector<double> r = fit.residual_m;
  AlternativeColumns::Values values{};
  for (std::size_t i = 0; i < r.size(); ++i) {
    for (const SparseRows::Entry& entry : fit.o.A.row(i)) {
      r[i] += entry.value * e.dU(static_cast<Eigen::Index>(entry.column));
    }
    const std::size_t count = columns.values(added, fit.o.rows[i], values);
    for (std::size_t k = 0; k < count; ++k) {
      r[i] -= values[k] * e.d(static_cast<Eigen::Index>(k));
    }
  }
  return r;
}

/// The alternative of a family with the largest decrease of chi2, if it is significant.
Result<std::optional<Alternative>> best_of(const Fit& fit, const AlternativeColumns& columns,
                                           std::span<const std::pair<Added, AddedColumns>> family,
                                           const Options& options) {
  const Added* best = nullptr;
  AddedColumns::Estimate best_estimate;
  const double x = natural_logarithm(kCauses * static_cast<double>(family.size()) / kFalseAlarm);
  const double noise = std::max(1.0, fit.noise.local * fit.noise.local);

  for (const auto& [added, sums] : family) {
    ABBE_TRY(check_stopped(options.stopped));
    AddedColumns::Estimate e = sums.estimate(fit.adjustment.cofactor_Q, noise * chi2_bound(1.0, x));
    const bool significant = e.drop > noise * chi2_bound(static_cast<double>(e.columns), x);
    if (significant && e.drop > best_estimate.drop) {
      best = &added;
      best_estimate = std::move(e);
    }
  }

  if (best == nullptr) {
    return std::nullopt;
  }

  const auto columns_added = static_cast<double>(best_estimate.columns);
  const std::vector<double> left = residuals_with(fit, columns, *best, best_estimate);
  const double factor =
      residual_noise(fit.o, left, fit.degrees_of_freedom - best_estimate.columns).variance_factor();

  // Second test, with the noise that remains when the alternative is applied. With the true cause
  // only white noise remains. If the cause is slow noise, it remains and raises `factor`; in the
  // first test every alternative decreases chi2 a little and would seem significant.
  if (!(best_estimate.drop > std::max(noise, factor) * chi2_bound(columns_added, x))) {
    return std::nullopt;
  }

  const double added_u_m = fit.norm.rms_of_columns_m(best_estimate.root_cov_dU);
  return Alternative{.cause = best->cause,
                     .text = columns.text(*best, best_estimate.d),
                     .explained = std::clamp(
                         best_estimate.drop / std::max(fit.excess(), best_estimate.drop), 0.0, 1.0),
                     .bias_m = fit.norm.rms_m(best_estimate.dU),
                     .u_m = root_sum_of_squares(fit.u_white_m, added_u_m) * std::sqrt(factor)};
}

/// The alternative that the data show an offset of the ranges too large for its prior. The sums in
/// `family` were computed from residuals from which the effect of the offset `estimated` is
/// subtracted.
Result<std::optional<Alternative>> offset_beyond_prior(const Fit& fit,
                                                       const AlternativeColumns& columns,
                                                       const AlternativeColumns::Family& family,
                                                       const RangeOffset& estimated) {
  const auto& [added, sums] = family.front();
  AddedColumns::Estimate e = sums.estimate(fit.adjustment.cofactor_Q, 0.0);
  if (e.columns == 0) {
    return std::nullopt;  // the model can reproduce the offset: only the prior determines it
  }

  constexpr double kNormal99 = 2.576;  // coverage factor for 99 %
  const double factor = fit.noise.variance_factor();
  const double beyond_m = e.d(0), of_data_m = estimated.value_m + beyond_m;
  const double u_of_data_m = e.u(0) * std::sqrt(factor);

  if (!(std::abs(of_data_m) >
        kNormal99 * root_sum_of_squares(u_of_data_m, fit.o.u_range_offset_m))) {
    return std::nullopt;
  }

  e.d(0) = of_data_m;
  return Alternative{
      .cause = Cause::RangeOffset,
      .text = message(columns.text(added, e.d), "; its stated uncertainty is ",
                      1e6 * fit.o.u_range_offset_m, " um"),
      .explained = std::clamp(e.drop / std::max(fit.excess(), e.drop), 0.0, 1.0),
      .bias_m = fit.norm.rms_m(e.dU),
      .u_m = root_sum_of_squares(fit.u_white_m, fit.norm.rms_of_columns_m(e.root_cov_dU)) *
             std::sqrt(factor)};
}

/// The alternative that another design matrix is correct, if it is clearly better.
Result<std::optional<Alternative>> other_design(const Fit& fit, const Solution& solution,
                                                Result<ParameterLayout> layout, Cause cause,
                                                std::string text, const Options& options) {
  constexpr std::size_t kMostUnknowns = 800;  // with more unknowns an adjustment takes longer than
                                              // one second
  Result<TableBasis> basis = std::move(layout).and_then(
      [&](ParameterLayout l) { return TableBasis::of(std::move(l), fit.o.basis.options()); });
  if (!basis || basis->size() > kMostUnknowns) {
    return std::nullopt;
  }

  const Observations other = with_basis(fit.o, *std::move(basis));
  ABBE_TRY(check_stopped(options.stopped));

  const Result<Adjustment> a = adjust(information_of(other), other, options.datum_weight);
  if (!a || other.rows.size() <= a->rank) {
    return std::nullopt;
  }

  const std::vector<double> left = residuals_m(other, a->U);
  const double drop = fit.chi2 - chi2(other, left);
  const double factor = residual_noise(other, left, other.rows.size() - a->rank).variance_factor();
  const auto rank = static_cast<double>(a->rank);
  const double more = cause == Cause::OtherRuns  // a run with its own tables: all its unknowns are
                                                 // additional
                          ? rank
                          : std::max(1.0, rank - static_cast<double>(fit.adjustment.rank));
  const double bound = std::max(fit.noise.local * fit.noise.local, factor) *
                       chi2_bound(more, natural_logarithm(kCauses / kFalseAlarm));
  constexpr double kClearlyBetter = 0.5;

  if (!(drop > kClearlyBetter * fit.excess() && drop > bound)) {
    return std::nullopt;
  }

  std::vector<Vector3> points, difference;
  const Vector3& t = fit.o.target_offset_m;
  for (const Vector3& q : sparse_grid(other.layout().nodes(), kGridCells)) {
    points.push_back(q + t);
    difference.push_back(
        solution.model.V_at(q, t) -
        volumetric_error(other.layout(), {a->U.data(), other.layout().model_size()}, q, t));
  }

  const auto bias = rigid_free(points, difference);
  const double u_m = rigid_free_norm(other.layout(), t).rms_u_m(a->covariance) * std::sqrt(factor);

  // Tables with too large distances between nodes have errors between all nodes. These errors
  // increase the stated uncertainty; a change of V below this uncertainty must not refuse the
  // model.
  const double stated_u_m = fit.u_white_m * std::sqrt(fit.noise.variance_factor());
  return Alternative{
      .cause = cause,
      .text = std::move(text),
      .explained = std::clamp(drop / fit.excess(), 0.0, 1.0),
      .bias_m = bias ? bias->rigid_free.rms_m : std::numeric_limits<double>::infinity(),
      .u_m = cause == Cause::NodeSpacing ? std::max(u_m, stated_u_m) : u_m};
}

Result<std::optional<Alternative>> other_order(const Fit& fit, const Solution& solution,
                                               const Options& options) {
  std::array<char, 3> order{'X', 'Y', 'Z'};
  std::string used;
  for (const Axis a : fit.o.layout().chain().order_w_to_t()) {
    used += letter(a);
  }

  std::optional<Alternative> best;
  do {
    const std::string letters(order.begin(), order.end());
    if (letters == used) {
      continue;
    }
    const auto chain =
        KinematicChain::parse(message("[w b ", order[0], " ", order[1], " ", order[2], " t]"));
    if (!chain) {
      continue;
    }
    auto found = other_design(
        fit, solution, ParameterLayout::observable_with_one_target(*chain, fit.o.layout().nodes()),
        Cause::ChainOrder,
        message("the order of the axes from workpiece to tool is ", letters, ", not ", used,
                " as in the machine's chain"),
        options);
    if (!found) {
      return found;
    }
    if (*found && (!best || (*found)->explained > best->explained)) {
      best = *std::move(found);
    }
  } while (std::next_permutation(order.begin(), order.end()));

  return best;
}

Result<std::optional<Alternative>> closer_nodes(const Fit& fit, const Solution& solution,
                                                const Options& options) {
  MachineNodes closer = fit.o.layout().nodes();
  double widest_m = 0.0;
  for (AxisNodes& axis : closer) {
    std::vector<double> nodes_m;
    for (std::size_t i = 0; i + 1 < axis.nodes_m.size(); ++i) {
      nodes_m.push_back(axis.nodes_m[i]);
      nodes_m.push_back(0.5 * (axis.nodes_m[i] + axis.nodes_m[i + 1]));
      widest_m = std::max(widest_m, axis.nodes_m[i + 1] - axis.nodes_m[i]);
    }
    nodes_m.push_back(axis.nodes_m.back());
    axis.nodes_m = std::move(nodes_m);
  }

  auto layout = ParameterLayout::observable_with_one_target(fit.o.layout().chain(), closer);
  return other_design(fit, solution, std::move(layout), Cause::NodeSpacing,
                      message("the nodes are too far apart (", 1e3 * widest_m,
                              " mm) for the errors of this machine"),
                      options);
}

/// The alternative that this run has its own tables, different from those of the other runs.
Result<std::optional<Alternative>> own_tables(const Fit& fit, const Solution& solution,
                                              const Options& options) {
  const ParameterLayout& shared = fit.o.layout();
  return other_design(
      fit, solution, ParameterLayout::observable_with_one_target(shared.chain(), shared.nodes()),
      Cause::OtherRuns,
      "the run contradicts the others: offset of its target, its files, or a change of the machine "
      "between the runs",
      options);
}

/// The design matrices that are tested if the residuals are too large.
std::vector<decltype(&closer_nodes)> other_designs(Tables tables) {
  if (tables == Tables::OfSeveralRuns) {
    return {own_tables};
  }
  return {other_order, closer_nodes};
}

}  // namespace

CorrectionSize correction_size(const VolumetricModel& model) {
  const RigidFreeNorm norm =
      rigid_free_norm(model.tables()->layout(), model.tool_offsets_m().front());
  const double of_misfit_m =
      std::sqrt(mean_misfit_m2(model, sparse_grid(model.nodes(), kGridCells)));
  return {norm.rms_m(model.U()),
          root_sum_of_squares(norm.rms_u_m(model.covariance()), of_misfit_m)};
}

std::string_view name(Cause cause) {
  switch (cause) {
    case Cause::Moved:
      return "moved";
    case Cause::Drift:
      return "drift";
    case Cause::Backlash:
      return "backlash";
    case Cause::Vertex:
      return "vertex";
    case Cause::Leg:
      return "leg";
    case Cause::RangeOffset:
      return "range-offset";
    case Cause::RangeStep:
      return "range-step";
    case Cause::ChainOrder:
      return "chain-order";
    case Cause::NodeSpacing:
      return "node-spacing";
    case Cause::OtherRuns:
      return "other-runs";
    case Cause::CorrelatedNoise:
      return "correlated-noise";
  }

  return "";
}

Result<std::vector<Alternative>> alternatives(const Observations& o, const Solution& solution,
                                              const Options& options, Tables tables) {
  const Fit fit = fit_of(o, solution);
  const AlternativeColumns columns(o);
  std::vector<Alternative> found;
  for (const auto& family : columns.sums(solution.residuals.after_m)) {
    const bool has_prior = o.u_range_offset_m > 0.0 && !family.empty() &&
                           family.front().first.cause == Cause::RangeOffset;
    Result<std::optional<Alternative>> best =
        has_prior ? offset_beyond_prior(fit, columns, family, solution.range_offset)
                  : best_of(fit, columns, family, options);
    ABBE_TRY(best);
    if (*best) {
      found.push_back(**std::move(best));
    }
  }

  if (fit.noise.variance_factor() > kSuspicious && fit.excess() > 0.0) {
    for (const auto design : other_designs(tables)) {
      Result<std::optional<Alternative>> better = design(fit, solution, options);
      ABBE_TRY(better);
      if (*better) {
        found.push_back(**std::move(better));
      }
    }
  }

  std::stable_sort(found.begin(), found.end(), [](const Alternative& a, const Alternative& b) {
    return a.explained > b.explained;
  });

  constexpr double kHalf = 0.5;
  if (fit.noise.correlation > kSuspicious && fit.noise.variance_factor() > kSuspicious &&
      (found.empty() || found.front().explained < kHalf)) {
    found.insert(found.begin(),
                 {.cause = Cause::CorrelatedNoise,
                  .text = message("the residuals are correlated over ", fit.noise.correlation,
                                  o.mode == Mode::Standstill ? " positions" : " segments",
                                  ": air turbulence, vibration, or an effect that is not modelled"),
                  .explained = 1.0,
                  .bias_m = 0.0,
                  .u_m = fit.u_white_m * std::sqrt(fit.noise.variance_factor())});
  }

  return found;
}

}  // namespace abbe::calib::otf

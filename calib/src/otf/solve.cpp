#include "abbe/calib/otf/solve.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "abbe/calib/otf/lack_of_fit.hpp"
#include "check_stopped.hpp"
#include "message.hpp"
#include "otf/added_columns.hpp"
#include "otf/row_residuals.hpp"

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

/// Factor for the covariance, from the residuals. Turbulence, vibration, a tracker worse than its
/// data sheet and effects that are not modelled increase the residuals; the stated uncertainty must
/// increase with them. Residuals smaller than the stated noise do not reduce the uncertainty.
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
  s.blocks = o.blocks;
  s.blocks_used = o.blocks_used;
  s.observations = o.rows.size();
  s.unknowns = o.unknowns();
  s.rank = a.rank;
  s.gauge_conditions = a.datum_defect;
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

/// Change of U per relative change of all ranges, which displaces a point by its vector from the
/// tracker. The part of this vector that is the same for all points changes only the rigid
/// unknowns.
Eigen::VectorXd dU_dscale(const Observations& o, const Adjustment& a) {
  const Vector3& tracker_m = o.alignment.T_machine_tracker.t_m;
  Eigen::VectorXd g = Eigen::VectorXd::Zero(a.U.size());
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const Observation& row = o.rows[i];
    const double s_m = row.direction.dot(row.axis_position_m + o.target_offset_m - tracker_m);
    for (const SparseRows::Entry& e : o.A.row(i)) {
      g(static_cast<Eigen::Index>(e.column)) += row.weight * e.value * s_m;
    }
  }
  return a.cofactor_Q * g;
}

/// Change of U per relative change of the scale of an axis: its positioning table changes with
/// slope 1 and is zero at the reference.
Eigen::VectorXd dU_daxis_scale(const Observations& o, Axis axis) {
  const ParameterLayout& layout = o.layout();
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(o.unknowns()));
  const AxisNodes& nodes = layout.nodes()[index(axis)];
  const std::optional<Table> positioning = layout.find({static_cast<Motion>(index(axis)), axis});
  for (std::size_t i = 0; positioning && i < nodes.nodes_m.size(); ++i) {
    slope(static_cast<Eigen::Index>(positioning->offset + i)) =
        nodes.nodes_m[i] - nodes.reference_m;
  }
  return slope;
}

/// Estimates the offset of the ranges in addition to the adjustment `a` with residuals
/// `residual_m`.
AddedColumns::Estimate range_offset(const Observations& o, const Adjustment& a,
                                    std::span<const double> residual_m, double factor) {
  AddedColumns sums(1, o.unknowns());
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const double c = drow_drange_offset(o, o.rows[i]);
    sums.add(o.rows[i], o.A.row(i), residual_m[i], std::span(&c, 1));
  }
  return sums.estimate_with_prior(a.cofactor_Q, o.u_range_offset_m, factor);
}

void report(const Options& options, double fraction) {
  if (options.progress) {
    options.progress(Stage::Solve, fraction);
  }
}

}  // namespace

std::string_view stop_reason(Estimator estimator) {
  return estimator == Estimator::Joint ? "converged" : "direct";
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
  const std::size_t needed = o.unknowns();
  if (o.rows.size() <= needed) {
    return failure(
        ErrorCode::TooFewObservations,
        message("adjustment: ", o.rows.size(), " observations for ", needed, " unknowns"));
  }

  report(options, 0.0);
  const RowInformation rows = information_of(o);
  report(options, 0.5);

  if (Result<void> running = check_stopped(options.stopped); !running) {
    return tl::unexpected(running.error());
  }

  Result<Adjustment> a = adjust(rows, o, options.gauge_weight);
  if (!a) {
    return tl::unexpected(a.error());
  }

  Result<ValidityVolume> validity = ValidityVolume::hull_of(o.covered_m);
  if (!validity) {
    return tl::unexpected(validity.error());
  }

  const Adjustment of_rows = *a;
  Residuals residuals{residuals_m(o, {}), residuals_m(o, a->U)};
  Statistics figures = statistics(o, *a, residuals);
  RangeOffset offset;
  Eigen::MatrixXd root_of_offset = Eigen::MatrixXd::Zero(a->U.size(), 1);

  if (o.u_range_offset_m > 0.0) {
    const auto e = range_offset(o, *a, residuals.after_m, figures.variance_factor);
    offset = {e.d(0), e.u(0)};
    root_of_offset = e.root_cov_dU;
    a->U -= e.dU;
    residuals.after_m = residuals_m(without_range_offset(o, offset.value_m), a->U);
    figures = statistics(o, *a, residuals);
  }

  a->covariance *= figures.variance_factor;
  a->covariance += root_of_offset * root_of_offset.transpose();
  if (o.u_scale > 0.0) {
    const Eigen::VectorXd moved = o.u_scale * dU_dscale(o, *a);
    a->covariance += moved * moved.transpose();
  }

  for (const Axis axis : kAllAxes) {
    const Eigen::VectorXd moved = o.u_axis_scale[index(axis)] * dU_daxis_scale(o, axis);
    a->covariance += moved * moved.transpose();
  }

  const auto n = static_cast<Eigen::Index>(o.basis.size());
  Result<VolumetricModel> model = VolumetricModel::from_vector(
      o.layout(), Gauge::G1, std::array{o.target_offset_m}, a->U.head(n),
      a->covariance.topLeftCorner(n, n), *std::move(validity));

  if (!model) {
    return tl::unexpected(model.error());
  }

  report(options, 1.0);
  return Solution{.estimator = Estimator::TwoStep,
                  .model = *std::move(model),
                  .rigid = a->U.segment<kRigidUnknowns>(n),
                  .covariance_with_rigid = a->covariance,
                  .adjustment = of_rows,
                  .T_machine_tracker = o.alignment.T_machine_tracker,
                  .statistics = figures,
                  .residuals = std::move(residuals),
                  .range_offset = offset};
}

}  // namespace abbe::calib::otf

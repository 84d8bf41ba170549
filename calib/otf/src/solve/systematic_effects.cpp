#include "solve/systematic_effects.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "abbe/calib/internal/geometry/axis_scale_columns.hpp"
#include "abbe/calib/internal/otf/observe/row_residuals.hpp"
#include "solve/added_columns.hpp"

namespace abbe::calib::otf {

Eigen::VectorXd dg_drange_scale(const Observations& o, const WhitenedRows& rows) {
  const Vector3& tracker_m = o.alignment.T_machine_tracker.t_m;
  std::vector<double> s_m;
  for (const Observation& row : o.rows) {
    s_m.push_back(row.direction.dot(row.axis_position_m + o.target_offset_m - tracker_m));
  }
  s_m = rows.values(s_m);

  Eigen::VectorXd g = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(o.unknowns()));
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    for (const SparseRows::Entry& e : rows.row(i)) {
      g(static_cast<Eigen::Index>(e.column)) += o.rows[i].weight * e.value * s_m[i];
    }
  }
  return g;
}

Eigen::VectorXd dU_daxis_scale(const Observations& o, Axis axis) {
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(o.unknowns()));
  slope.head(static_cast<Eigen::Index>(o.layout().model_size())) =
      axis_scale_columns(o.layout()).col(static_cast<Eigen::Index>(index(axis)));
  return slope;
}

namespace {

/// The range offset (if it has a prior) and the errors of two axes, as added columns.
class RunEffects {
 public:
  RunEffects(const Observations& o, const WhitenedRows& rows, std::span<const double> residual_m)
      : o_(o), sums_(kColumns, o.unknowns()) {
    RowMatrix values = RowMatrix::Zero(std::ssize(o.rows), kColumns);
    for (std::size_t i = 0; i < o.rows.size(); ++i) {
      set_values(values.row(static_cast<Eigen::Index>(i)), o.rows[i]);
    }
    rows.apply(values);
    const std::vector<double> r_m = rows.values(residual_m);
    for (std::size_t i = 0; i < o.rows.size(); ++i) {
      sums_.add(o.rows[i], rows.row(i), r_m[i],
                std::span(values.row(static_cast<Eigen::Index>(i)).data(), kColumns));
    }
  }

  /// Estimates both for the size s of the errors of two axes (two_axis_errors.hpp). s = 0: without
  /// these errors.
  [[nodiscard]] AddedColumns::Estimate estimate(const Eigen::MatrixXd& Q, double s_m,
                                                double factor) const {
    if (s_m > 0.0) {
      constexpr double kNone_m = 1e-12;
      Eigen::VectorXd u = Eigen::VectorXd::Constant(kColumns, s_m);
      u(0) = has_offset() ? o_.u_range_offset_m : kNone_m;
      return sums_.estimate_with_priors(Q, u, factor);
    }
    if (has_offset()) {
      return offset_alone(Q, o_.u_range_offset_m, factor);
    }
    const Eigen::Index n = Q.rows();
    return {.dU = Eigen::VectorXd::Zero(n), .root_cov_dU = Eigen::MatrixXd::Zero(n, 1)};
  }
  [[nodiscard]] AddedColumns::Estimate offset_alone(const Eigen::MatrixXd& Q, double u_m,
                                                    double factor) const {
    return sums_.first(1).estimate_with_prior(Q, u_m, factor);
  }
  [[nodiscard]] bool has_offset() const { return o_.u_range_offset_m > 0.0; }

 private:
  static constexpr std::size_t kColumns = 1 + kTwoAxisErrors;

  void set_values(Eigen::Ref<Eigen::RowVectorXd> values, const Observation& row) const {
    values(0) = drow_drange_offset(o_, row);
    const Vector3 products = TwoAxisErrors::products(o_.layout().nodes(), row.axis_position_m);
    for (Eigen::Index pair = 0; pair < 3; ++pair) {
      values.segment<3>(1 + 3 * pair) = products(pair) * row.direction.transpose();
    }
  }

  const Observations& o_;
  AddedColumns sums_;
};

/// The size of the errors of two axes with the largest likelihood. It is 0 if the errors are not
/// significant. It is also 0 if a range offset larger than stated explains the residuals: both
/// effects bend the volume in a similar way, and such an offset is a fault that must be reported
/// (lack_of_fit.hpp).
double likely_two_axis_errors_m(const RunEffects& effects, const Eigen::MatrixXd& Q,
                                double factor) {
  constexpr std::array kSizes_m{0.25e-6, 0.5e-6, 1e-6, 2e-6, 4e-6, 8e-6, 16e-6, 32e-6};
  constexpr double kBeyondChance = 25.0;  // of 2 ln L; reached by chance with a probability below
                                          // 1e-5
  constexpr double kLargeOffset_m = 1e-3;
  const double without =
      std::max(effects.estimate(Q, 0.0, factor).twice_log_likelihood,
               effects.offset_alone(Q, kLargeOffset_m, factor).twice_log_likelihood);
  double best_m = 0.0, best = without + kBeyondChance;
  for (const double s_m : kSizes_m) {
    const double found = effects.estimate(Q, s_m, factor).twice_log_likelihood;
    if (found > best) {
      best_m = s_m;
      best = found;
    }
  }
  return best_m;
}

TwoAxisErrors two_axis_errors(const AddedColumns::Estimate& e) {
  TwoAxisErrors found;
  const Eigen::Index first = e.d.size() - static_cast<Eigen::Index>(kTwoAxisErrors);
  for (std::size_t i = 0; i < kTwoAxisErrors; ++i) {
    found.D_m[i] = e.d(first + static_cast<Eigen::Index>(i));
    found.u_m[i] = e.u(first + static_cast<Eigen::Index>(i));
  }
  return found;
}

}  // namespace

Observations without_two_axis_errors(Observations o, const TwoAxisErrors& errors) {
  for (Observation& row : o.rows) {
    row.y_m -= row.direction.dot(errors.V_m(o.layout().nodes(), row.axis_position_m));
  }
  return o;
}

WithRunEffects with_run_effects(const Observations& o, const WhitenedRows& rows,
                                const Adjustment& a, std::span<const double> residual_m,
                                double factor) {
  const RunEffects effects(o, rows, residual_m);
  const double s_m = likely_two_axis_errors_m(effects, a.cofactor_Q, factor);
  const AddedColumns::Estimate e = effects.estimate(a.cofactor_Q, s_m, factor);

  WithRunEffects with{.U = a.U - e.dU, .root_of_covariance = e.root_cov_dU};
  Observations left = o;
  if (effects.has_offset()) {
    with.offset = {e.d(0), e.u(0)};
    left = without_range_offset(std::move(left), with.offset.value_m);
    // Covariance of U and the offset, divided by the variance of the offset; the other effects are
    // free.
    const Eigen::VectorXd dU_dd =
        e.root_cov_dU * e.root_cov_d.row(0).transpose() / (e.u(0) * e.u(0));
    with.in_model =
        OffsetInModel{.dU_dd = dU_dd.head(static_cast<Eigen::Index>(o.layout().model_size())),
                      .value_m = with.offset.value_m,
                      .u_m = with.offset.u_m,
                      .u_prior_m = o.u_range_offset_m};
  }
  if (s_m > 0.0) {
    with.two_axes = two_axis_errors(e);
    left = without_two_axis_errors(std::move(left), *with.two_axes);
  }
  with.residual_m = residuals_m(left, with.U);
  return with;
}

void add_scale_effects(Eigen::MatrixXd& covariance, const Observations& o, const WhitenedRows& rows,
                       const Eigen::MatrixXd& Q) {
  if (o.u_scale > 0.0) {
    const Eigen::VectorXd moved = o.u_scale * (Q * dg_drange_scale(o, rows));
    covariance += moved * moved.transpose();
  }

  for (const Axis axis : kAllAxes) {
    const Eigen::VectorXd moved = o.u_axis_scale[index(axis)] * dU_daxis_scale(o, axis);
    covariance += moved * moved.transpose();
  }
}

}  // namespace abbe::calib::otf

#include "otf/systematic_effects.hpp"

#include <vector>

#include "axis_scale_columns.hpp"
#include "otf/added_columns.hpp"
#include "otf/row_residuals.hpp"

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

WithRangeOffset with_range_offset(const Observations& o, const WhitenedRows& rows,
                                  const Adjustment& a, std::span<const double> residual_m,
                                  double factor) {
  AddedColumns sums(1, o.unknowns());
  std::vector<double> c;
  for (const Observation& row : o.rows) {
    c.push_back(drow_drange_offset(o, row));
  }
  c = rows.values(c);
  const std::vector<double> r_m = rows.values(residual_m);
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    sums.add(o.rows[i], rows.row(i), r_m[i], std::span(&c[i], 1));
  }

  const AddedColumns::Estimate e =
      sums.estimate_with_prior(a.cofactor_Q, o.u_range_offset_m, factor);
  const RangeOffset offset{e.d(0), e.u(0)};
  const Eigen::VectorXd U = a.U - e.dU;
  const OffsetInModel in_model{
      .dU_dd =
          sums.reduced(a.cofactor_Q).dU_dd.col(0).head(static_cast<Eigen::Index>(o.basis.size())),
      .value_m = offset.value_m,
      .u_m = offset.u_m,
      .u_prior_m = o.u_range_offset_m};
  return {offset, U, e.root_cov_dU, residuals_m(without_range_offset(o, offset.value_m), U),
          in_model};
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

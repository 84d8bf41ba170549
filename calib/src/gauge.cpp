#include "abbe/calib/gauge.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

#include "abbe/calib/model_comparison.hpp"
#include "abbe/calib/rigid_body_model.hpp"
#include "message.hpp"

namespace abbe::calib {
namespace {

using Condition = Eigen::RowVectorXd;

/// A position closer to a node than this fraction of a cell counts as the node; nodes computed from
/// a range differ by rounding (1e-16). The condition then contains only this node, so that its
/// value is exactly zero. With a neighbour weight below 1e-6 in the condition, the variance of the
/// node would be below 1e-12 of that of the neighbour, and rounding could make it negative. V
/// changes by the gradient times 1e-6 cells: 0.25 nm at the steepest gradient of 5 mm/m and 50 mm.
constexpr double kAtNode = 1e-6;

Condition zero_at(const ParameterLayout& layout, const Table& table, double position_m) {
  Condition k = Condition::Zero(static_cast<Eigen::Index>(layout.fit_size()));
  const BasisRow b = basis_row(layout.nodes()[index(table.motion.axis)].nodes_m, position_m);
  const auto first = static_cast<Eigen::Index>(table.offset + b.first);
  if (std::abs(b.weight[1]) < kAtNode) {
    k(first) = 1.0;
  } else if (std::abs(b.weight[0]) < kAtNode) {
    k(first + 1) = 1.0;
  } else {
    k(first) = b.weight[0];
    k(first + 1) = b.weight[1];
  }
  return k;
}

}  // namespace

Eigen::MatrixXd gauge_conditions(Gauge, const ParameterLayout& layout) {
  std::vector<Condition> conditions;
  for (const Table& table : layout.tables()) {
    const AxisNodes& axis = layout.nodes()[index(table.motion.axis)];
    if (is_straightness(table.motion)) {
      conditions.push_back(zero_at(layout, table, axis.nodes_m.front()));
      conditions.push_back(zero_at(layout, table, axis.nodes_m.back()));
    } else {
      conditions.push_back(zero_at(layout, table, axis.reference_m));
    }
  }

  Eigen::MatrixXd K(static_cast<Eigen::Index>(conditions.size()),
                    static_cast<Eigen::Index>(layout.fit_size()));
  for (std::size_t i = 0; i < conditions.size(); ++i) {
    K.row(static_cast<Eigen::Index>(i)) = conditions[i];
  }

  return K;
}

Eigen::MatrixXd unobservable_combinations(const ParameterLayout& layout,
                                          std::span<const Vector3> targets_m) {
  const auto parameters = static_cast<Eigen::Index>(layout.fit_size());
  const Eigen::Index n = parameters + 3 * std::max<Eigen::Index>(0, std::ssize(targets_m) - 1);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);

  for (std::size_t target = 0; target < targets_m.size(); ++target) {
    for (const Vector3& q : tensor_grid(layout.nodes())) {
      const DesignColumns columns = design_columns_with_rigid(layout, q, targets_m[target]);
      std::vector<Column> row(columns.span().begin(), columns.span().end());
      for (std::size_t k = 0; k < 3 && target > 0; ++k) {
        row.push_back({layout.fit_size() + 3 * (target - 1) + k,
                       Vector3::Unit(static_cast<Eigen::Index>(k))});
      }
      for (const Column& i : row) {
        for (const Column& j : row) {
          H(static_cast<Eigen::Index>(i.parameter), static_cast<Eigen::Index>(j.parameter)) +=
              i.dV_dU.dot(j.dV_dU);
        }
      }
    }
  }

  const Eigen::VectorXd scale =
      H.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 1.0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * H *
                                                             scale.asDiagonal());

  // The scaled eigenvalues of complete data form two groups for any order of the axes: above 5e-3,
  // and at rounding level (1e-15). Any threshold between them is suitable.
  constexpr double kZero = 1e-11;
  Eigen::Index nullity = 0;
  while (nullity < n && eigen.eigenvalues()(nullity) < kZero * eigen.eigenvalues()(n - 1)) {
    ++nullity;
  }

  return (scale.asDiagonal() * eigen.eigenvectors().leftCols(nullity)).topRows(parameters);
}

Result<Eigen::VectorXd> to_gauge(Gauge gauge, const ParameterLayout& layout,
                                 std::span<const Vector3> targets_m, const Eigen::VectorXd& U) {
  const Eigen::MatrixXd N = unobservable_combinations(layout, targets_m);
  const Eigen::MatrixXd K = gauge_conditions(gauge, layout);
  if (N.cols() > K.rows()) {
    return failure(
        ErrorCode::DegenerateGeometry,
        message("gauge: ", targets_m.size(), " tool offsets leave ", N.cols(), " combinations of ",
                layout.tables().size(), " tables undetermined, the gauge fixes ", K.rows(),
                "; 18 tables need three offsets that are not on a line"));
  }
  const Eigen::VectorXd z = (K * N).colPivHouseholderQr().solve(-(K * U));
  return U + N * z;
}

}  // namespace abbe::calib

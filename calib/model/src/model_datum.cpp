#include "abbe/calib/model/model_datum.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

#include "abbe/calib/estimation/datum.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/estimation/null_space.hpp"
#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/model/model_comparison.hpp"

namespace abbe::calib {
namespace {

using Condition = Eigen::RowVectorXd;

/// A position closer to a node than this fraction of a cell counts as the node, because nodes
/// computed from a range differ by rounding (1e-16). The condition then contains only this node, so
/// that the value at the node is exactly zero. If the condition also contained the neighbour node
/// with a weight below 1e-6, the variance of the node would be below 1e-12 of that of the
/// neighbour, and rounding could make it negative. V changes by the gradient times 1e-6 cells: 0.25
/// nm at the steepest gradient of 5 mm/m and cells of 50 mm.
constexpr double kAtNode = 1e-6;

Condition zero_at(const TableBasis& basis, const Table& table, double position_m,
                  std::size_t unknowns) {
  Condition k = Condition::Zero(static_cast<Eigen::Index>(unknowns));
  const BasisRow cell =
      basis_row(basis.layout().nodes()[index(table.motion.axis)].nodes_m, position_m);
  const auto first = static_cast<Eigen::Index>(table.offset + cell.first);
  if (std::abs(cell.weight[1]) < kAtNode) {
    k(first) = 1.0;
  } else if (std::abs(cell.weight[0]) < kAtNode) {
    k(first + 1) = 1.0;
  } else {
    const NodeWeights weights = basis.interpolation(table.motion.axis).at(position_m);
    for (std::size_t i = 0; i < weights.count(); ++i) {
      k(static_cast<Eigen::Index>(table.offset + weights.first() + i)) = weights[i];
    }
  }
  return k;
}

/// Basis of linear tables with this layout. TableBasis::of() cannot fail for linear tables, because
/// the number of nodes is limited only for cubic ones.
TableBasis linear_basis(const ParameterLayout& layout) {
  return *TableBasis::of(layout);
}

/// Adds complete data of one target offset: all three components of V at every node position.
void add_complete_data(estimation::Information& data, const ParameterLayout& layout,
                       const Vector3& target_m, std::size_t target) {
  estimation::RowBatch batch(data.unknowns());
  for (const Vector3& q : tensor_grid(layout.nodes())) {
    const DesignColumns columns = design_columns_with_rigid(layout, q, target_m);
    for (Eigen::Index component = 0; component < 3; ++component) {
      std::vector<estimation::RowEntry> row;
      for (const Column& c : columns.span()) {
        row.push_back({c.parameter, c.dV_dU(component)});
      }
      if (target > 0) {
        row.push_back(
            {layout.fit_size() + 3 * (target - 1) + static_cast<std::size_t>(component), 1.0});
      }
      batch.append(row, 0.0, 1.0);
      if (batch.full()) {
        data.add(batch);
      }
    }
  }
  data.add(batch);
}

}  // namespace

Eigen::MatrixXd datum_conditions(ModelDatum, const TableBasis& basis, std::size_t unknowns) {
  std::vector<Condition> conditions;
  for (const Table& table : basis.layout().tables()) {
    const AxisNodes& axis = basis.layout().nodes()[index(table.motion.axis)];
    if (is_straightness(table.motion)) {
      conditions.push_back(zero_at(basis, table, axis.nodes_m.front(), unknowns));
      conditions.push_back(zero_at(basis, table, axis.nodes_m.back(), unknowns));
    } else {
      conditions.push_back(zero_at(basis, table, axis.reference_m, unknowns));
    }
  }

  Eigen::MatrixXd K(std::ssize(conditions), static_cast<Eigen::Index>(unknowns));
  for (std::size_t i = 0; i < conditions.size(); ++i) {
    K.row(static_cast<Eigen::Index>(i)) = conditions[i];
  }

  return K;
}

Eigen::MatrixXd datum_conditions(ModelDatum datum, const ParameterLayout& layout) {
  return datum_conditions(datum, linear_basis(layout), layout.fit_size());
}

Eigen::MatrixXd unobservable_combinations(const ParameterLayout& layout,
                                          std::span<const Vector3> targets_m) {
  const std::size_t more_targets = targets_m.empty() ? 0 : targets_m.size() - 1;
  estimation::Information data(layout.fit_size() + 3 * more_targets);
  for (std::size_t target = 0; target < targets_m.size(); ++target) {
    add_complete_data(data, layout, targets_m[target], target);
  }
  return estimation::null_space(data).basis.topRows(static_cast<Eigen::Index>(layout.fit_size()));
}

Result<Eigen::VectorXd> to_datum(ModelDatum datum, const ParameterLayout& layout,
                                 std::span<const Vector3> targets_m, const Eigen::VectorXd& U) {
  const Eigen::MatrixXd N = unobservable_combinations(layout, targets_m);
  const Eigen::MatrixXd K = datum_conditions(datum, layout);
  if (N.cols() > K.rows()) {
    return failure(
        ErrorCode::DegenerateGeometry,
        message("datum: ", targets_m.size(), " tool offsets leave ", N.cols(), " combinations of ",
                layout.tables().size(), " tables undetermined, the datum fixes ", K.rows(),
                "; 18 tables need three offsets that are not on a line"));
  }
  return estimation::Datum(K).transformation(N).map(
      [&](const Eigen::MatrixXd& S) -> Eigen::VectorXd { return S * U; });
}

}  // namespace abbe::calib

#include "abbe/calib/internal/geometry/cell_form.hpp"

#include <array>

#include "abbe/calib/internal/geometry/rigid_body_effects.hpp"

namespace abbe::calib {
namespace {

/// Matrix M of the interpolation of an axis (axis_interpolation.hpp); zero for linear tables.
Eigen::MatrixXd curvature_matrix_of(const AxisInterpolation& axis) {
  const auto n = static_cast<Eigen::Index>(axis.size());
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t i = 0; i < axis.size(); ++i) {
    const std::span<const double> row = axis.curvature_row(i);
    for (std::size_t j = 0; j < row.size(); ++j) {
      M(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = row[j];
    }
  }
  return M;
}

void push_cell(ModelColumns& columns, std::size_t offset, std::size_t nodes,
               const NodeWeights::OfCell& cell, const Vector3& effect_of_unit) {
  const std::size_t value = offset + cell.k, curvature = value + nodes;
  columns.push(value, cell.value[0] * effect_of_unit);
  columns.push(value + 1, cell.value[1] * effect_of_unit);
  columns.push(curvature, cell.curvature[0] * effect_of_unit);
  columns.push(curvature + 1, cell.curvature[1] * effect_of_unit);
}

}  // namespace

Eigen::MatrixXd with_curvatures(const TableBasis& basis, const Eigen::MatrixXd& X) {
  const ParameterLayout& layout = basis.layout();
  const auto tables = static_cast<Eigen::Index>(layout.squareness_offset());
  const auto squareness = static_cast<Eigen::Index>(kSquarenessNames.size());
  Eigen::MatrixXd Z(2 * tables + squareness, X.cols());
  std::array<Eigen::MatrixXd, 3> M;
  for (const Axis a : kAllAxes) {
    M[index(a)] = curvature_matrix_of(basis.interpolation(a));
  }

  for (const Table& table : layout.tables()) {
    const auto offset = static_cast<Eigen::Index>(table.offset);
    const auto nodes = static_cast<Eigen::Index>(layout.node_count(table.motion.axis));
    Z.middleRows(2 * offset, nodes) = X.middleRows(offset, nodes);
    Z.middleRows(2 * offset + nodes, nodes).noalias() =
        M[index(table.motion.axis)] * X.middleRows(offset, nodes);
  }

  Z.bottomRows(squareness) = X.middleRows(tables, squareness);
  return Z;
}

Eigen::MatrixXd covariance_with_curvatures(const TableBasis& basis, const Eigen::MatrixXd& C) {
  const Eigen::MatrixXd half = with_curvatures(basis, C).transpose();
  return with_curvatures(basis, half);
}

void append_cell_columns(const TableBasis& basis, const MachineState& state,
                         ModelColumns& columns) {
  const ParameterLayout& layout = basis.layout();
  const std::array<Vector3, 3> lever_m = levers_m(layout.chain(), state.q_m, state.tool_offset_m);
  std::array<NodeWeights::OfCell, 3> cell;
  for (const Axis a : kAllAxes) {
    cell[index(a)] =
        basis.interpolation(a).at(state.q_m(static_cast<Eigen::Index>(index(a)))).of_cell();
  }

  for (const Table& table : layout.tables()) {
    const std::size_t a = index(table.motion.axis);
    push_cell(columns, 2 * table.offset, layout.node_count(table.motion.axis), cell[a],
              effect(table.motion, lever_m[a]));
  }

  std::size_t parameter = 2 * layout.squareness_offset();
  for (const Vector3& c : squareness_effects(state.q_m - layout.squareness_from_m())) {
    columns.push(parameter++, c);
  }
}

}  // namespace abbe::calib

#include "abbe/calib/internal/geometry/rigid_body_model.hpp"

#include "abbe/calib/internal/geometry/rigid_body_effects.hpp"

namespace abbe::calib {
namespace {

/// Levers and basis rows of the three axes at one position.
struct AxisStates {
  std::array<Vector3, 3> lever_m;
  std::array<BasisRow, 3> basis;
};

AxisStates axis_states(const ParameterLayout& layout, const Vector3& q, const Vector3& t) {
  AxisStates at{levers_m(layout.chain(), q, t), {}};
  for (std::size_t a = 0; a < 3; ++a) {
    at.basis[a] = basis_row(layout.nodes()[a].nodes_m, q(static_cast<Eigen::Index>(a)));
  }
  return at;
}

void push(DesignColumns& columns, std::size_t parameter, const Vector3& dV_dU) {
  columns.column[columns.count++] = {parameter, dV_dU};
}

}  // namespace

Vector3 lever(const KinematicChain& chain, Axis a, const Vector3& axis_position_m,
              const Vector3& target_offset_m) {
  Vector3 l = target_offset_m;
  for (std::size_t i = 2; i > chain.place(a); --i) {
    const auto k = static_cast<Eigen::Index>(index(chain.order_w_to_t()[i]));
    l(k) += axis_position_m(k);
  }
  return l;
}

DesignColumns design_columns(const ParameterLayout& layout, const Vector3& axis_position_m,
                             const Vector3& target_offset_m) {
  const AxisStates at = axis_states(layout, axis_position_m, target_offset_m);
  DesignColumns columns;
  for (const Table& table : layout.tables()) {
    const std::size_t a = index(table.motion.axis);
    const Vector3 c = effect(table.motion, at.lever_m[a]);
    const BasisRow& b = at.basis[a];
    push(columns, table.offset + b.first, b.weight[0] * c);
    push(columns, table.offset + b.first + 1, b.weight[1] * c);
  }

  std::size_t parameter = layout.squareness_offset();
  for (const Vector3& c : squareness_effects(axis_position_m - layout.squareness_from_m())) {
    push(columns, parameter++, c);
  }

  return columns;
}

DesignColumns design_columns_with_rigid(const ParameterLayout& layout,
                                        const Vector3& axis_position_m,
                                        const Vector3& target_offset_m) {
  DesignColumns columns = design_columns(layout, axis_position_m, target_offset_m);
  const Matrix3 rotation = rotation_effect(axis_position_m + target_offset_m);
  for (Eigen::Index k = 0; k < 3; ++k) {
    push(columns, layout.rigid_offset() + static_cast<std::size_t>(k), Vector3::Unit(k));
  }
  for (Eigen::Index k = 0; k < 3; ++k) {
    push(columns, layout.rigid_offset() + 3 + static_cast<std::size_t>(k), rotation.col(k));
  }
  return columns;
}

Vector3 volumetric_error(const ParameterLayout& layout, std::span<const double> U,
                         const Vector3& axis_position_m, const Vector3& target_offset_m) {
  const AxisStates at = axis_states(layout, axis_position_m, target_offset_m);
  Vector3 V = Vector3::Zero();
  for (const Table& table : layout.tables()) {
    const std::size_t a = index(table.motion.axis);
    const BasisRow& b = at.basis[a];
    const double* node = &U[table.offset + b.first];
    V += effect(table.motion, at.lever_m[a]) * (b.weight[0] * node[0] + b.weight[1] * node[1]);
  }

  std::size_t parameter = layout.squareness_offset();
  for (const Vector3& c : squareness_effects(axis_position_m - layout.squareness_from_m())) {
    V += c * U[parameter++];
  }

  return V;
}

}  // namespace abbe::calib

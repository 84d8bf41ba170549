#include "abbe/calib/geometry/travel_differences.hpp"

#include <vector>

#include "abbe/calib/internal/geometry/effect_of_travel.hpp"

namespace abbe::calib {
namespace {

/// The derivatives dV/dU and dV/dD at a state.
struct ColumnsOfTravel {
  Eigen::Matrix3Xd U, D;
};

ColumnsOfTravel columns_of_travel(const TableBasis& basis, const MachineState& state) {
  std::vector<Column> memory(basis.most_columns());
  ModelColumns columns(memory);
  basis.append_columns(state, columns);

  const std::size_t n = basis.layout().model_size();
  ColumnsOfTravel all{Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(n)),
                      Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(basis.size() - n))};
  for (const Column& c : columns.span()) {
    auto& part = c.parameter < n ? all.U : all.D;
    part.col(static_cast<Eigen::Index>(c.parameter < n ? c.parameter : c.parameter - n)) += c.dV_dU;
  }
  return all;
}

AxisTravel only(Axis axis, Travel travel) {
  AxisTravel all{};
  all[index(axis)] = travel;
  return all;
}

}  // namespace

Eigen::MatrixXd half_differences(const TableBasis& basis, const Eigen::VectorXd& D) {
  const ParameterLayout& layout = basis.layout();
  const bool per_node = basis.travel() == TravelDependence::Tables;
  Eigen::MatrixXd half = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(layout.model_size()), 3);
  Eigen::Index next = 0;

  for (const Table& table : layout.tables()) {
    const auto first = static_cast<Eigen::Index>(table.offset),
               nodes = static_cast<Eigen::Index>(layout.node_count(table.motion.axis));
    auto of_table =
        half.col(static_cast<Eigen::Index>(index(table.motion.axis))).segment(first, nodes);
    if (per_node) {
      of_table = 0.5 * D.segment(next, nodes);
    } else {
      of_table.setConstant(0.5 * D(next));
    }
    next += per_node ? nodes : 1;
  }

  return half;
}

TravelEffect effect_of_travel(const TableBasis& basis, const TravelDifferences& d,
                              const MachineState& state) {
  TravelEffect effect;
  for (const Axis a : kAllAxes) {
    const Travel travel = state.travel[index(a)];
    MachineState of_axis = state;
    of_axis.travel = only(a, travel == Travel::Unknown ? Travel::Forward : travel);
    const Eigen::Matrix3Xd dV_dD = columns_of_travel(basis, of_axis).D;
    const Vector3 h_m = dV_dD * d.D;
    if (travel == Travel::Unknown) {
      effect.cov_m2 += dV_dD * d.covariance * dV_dD.transpose();
    } else {
      effect.V_m += h_m;
      effect.cov_m2 -= h_m * h_m.transpose();
    }
  }

  const ColumnsOfTravel known = columns_of_travel(basis, state);
  const Matrix3 mixed = known.U * d.cov_U_D * known.D.transpose();
  effect.cov_m2 += mixed + mixed.transpose() + known.D * d.covariance * known.D.transpose();
  return effect;
}

}  // namespace abbe::calib

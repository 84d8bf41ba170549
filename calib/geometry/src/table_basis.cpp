#include "abbe/calib/geometry/table_basis.hpp"

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/geometry/rigid_body_effects.hpp"

namespace abbe::calib {
namespace {

/// Levers and weights of the nodes of the three axes at one state.
struct TableState {
  std::array<Vector3, 3> lever_m;
  std::array<NodeWeights, 3> weights;
};

TableState table_state(const TableBasis& basis, const MachineState& state) {
  TableState at{levers_m(basis.layout().chain(), state.q_m, state.tool_offset_m), {}};
  for (const Axis a : kAllAxes) {
    at.weights[index(a)] =
        basis.interpolation(a).at(state.q_m(static_cast<Eigen::Index>(index(a))));
  }
  return at;
}

void push_weighted(ModelColumns& columns, std::size_t offset, const NodeWeights& weights,
                   const Vector3& effect_of_unit) {
  const std::size_t first = offset + weights.first();
  for (std::size_t i = 0; i < weights.count(); ++i) {
    columns.push(first + i, weights[i] * effect_of_unit);
  }
}

double weighted_sum(const NodeWeights& weights, std::span<const double> node_values) {
  double sum = weights[0] * node_values[weights.first()];
  for (std::size_t i = 1; i < weights.count(); ++i) {
    sum += weights[i] * node_values[weights.first() + i];
  }
  return sum;
}

/// The factor s / 2 of table_basis.hpp: 0.5 forward, -0.5 backward, 0 unknown.
double half_sign(Travel travel) {
  return 0.5 * static_cast<double>(travel);
}

}  // namespace

Result<TableBasis> TableBasis::of(ParameterLayout layout, const TableOptions& options) {
  TableBasis basis(std::move(layout));
  for (const Axis a : kAllAxes) {
    Result<AxisInterpolation> axis = AxisInterpolation::of(basis.layout_.nodes()[index(a)].nodes_m,
                                                           options.interpolation[index(a)]);
    if (!axis) {
      return failure(axis.error().code, message("axis ", letter(a), ": ", axis.error().text));
    }
    basis.axis_[index(a)] = *std::move(axis);
  }

  basis.travel_ = options.travel;
  basis.size_ = basis.layout_.model_size();
  basis.most_columns_ = kSquarenessNames.size();
  for (const Table& table : basis.layout_.tables()) {
    const std::size_t weights = basis.axis_[index(table.motion.axis)].most_weights();
    basis.most_columns_ += weights;
    if (options.travel == TravelDependence::Backlash) {
      basis.size_ += 1;
      basis.most_columns_ += 1;
    } else if (options.travel == TravelDependence::Tables) {
      basis.size_ += basis.layout_.node_count(table.motion.axis);
      basis.most_columns_ += weights;
    }
  }

  return basis;
}

void TableBasis::append_columns(const MachineState& state, ModelColumns& columns) const {
  const TableState at = table_state(*this, state);
  for (const Table& table : layout_.tables()) {
    const std::size_t a = index(table.motion.axis);
    push_weighted(columns, table.offset, at.weights[a], effect(table.motion, at.lever_m[a]));
  }

  std::size_t parameter = layout_.squareness_offset();
  for (const Vector3& c : squareness_effects(state.q_m - layout_.squareness_from_m())) {
    columns.push(parameter++, c);
  }

  if (travel_ != TravelDependence::None) {
    append_travel_columns(state, columns);
  }
}

void TableBasis::append_travel_columns(const MachineState& state, ModelColumns& columns) const {
  const TableState at = table_state(*this, state);
  std::size_t parameter = layout_.model_size();
  for (const Table& table : layout_.tables()) {
    const std::size_t a = index(table.motion.axis);
    const double half = half_sign(state.travel[a]);
    const Vector3 c = half * effect(table.motion, at.lever_m[a]);
    if (travel_ == TravelDependence::Backlash) {
      if (half != 0.0) {
        columns.push(parameter, c);
      }
      ++parameter;
      continue;
    }
    if (half != 0.0) {
      push_weighted(columns, parameter, at.weights[a], c);
    }
    parameter += layout_.node_count(table.motion.axis);
  }
}

Vector3 TableBasis::V_m(const MachineState& state, std::span<const double> U) const {
  const TableState at = table_state(*this, state);
  Vector3 V = Vector3::Zero();
  std::size_t of_travel = layout_.model_size();
  for (const Table& table : layout_.tables()) {
    const std::size_t a = index(table.motion.axis), nodes = layout_.node_count(table.motion.axis);
    double value = weighted_sum(at.weights[a], U.subspan(table.offset, nodes));
    const double half = half_sign(state.travel[a]);
    if (travel_ == TravelDependence::Backlash) {
      value += half * U[of_travel++];
    } else if (travel_ == TravelDependence::Tables) {
      value += half * weighted_sum(at.weights[a], U.subspan(of_travel, nodes));
      of_travel += nodes;
    }
    V += effect(table.motion, at.lever_m[a]) * value;
  }

  std::size_t parameter = layout_.squareness_offset();
  for (const Vector3& c : squareness_effects(state.q_m - layout_.squareness_from_m())) {
    V += c * U[parameter++];
  }

  return V;
}

std::string TableBasis::label(std::size_t parameter) const {
  if (parameter < layout_.model_size()) {
    return layout_.label(parameter);
  }

  std::size_t rest = parameter - layout_.model_size();
  if (travel_ == TravelDependence::Backlash) {
    return message("backlash of ", calib::name(layout_.tables()[rest].motion));
  }

  std::size_t table = 0;
  while (rest >= layout_.node_count(layout_.tables()[table].motion.axis)) {
    rest -= layout_.node_count(layout_.tables()[table].motion.axis);
    ++table;
  }

  return message("travel difference of ", layout_.label(layout_.tables()[table].offset + rest));
}

}  // namespace abbe::calib

#include <algorithm>
#include <cmath>

#include "abbe/calib/export/held_correction.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/geometry/rigid_body_effects.hpp"
#include "abbe/result/try.hpp"
#include "motion_fit.hpp"

namespace abbe::calib {
namespace {

/// For each axis its nodes if they are at most kMostFittedNodes, else kMostFittedNodes nodes with
/// equal steps.
GridAxes fitted_nodes(const GridAxes& nodes_m) {
  GridAxes fitted = nodes_m;
  for (auto& nodes : fitted) {
    if (nodes.size() <= kMostFittedNodes) continue;
    const double first = nodes.front(), last = nodes.back();
    nodes.resize(kMostFittedNodes);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const double w = static_cast<double>(i) / static_cast<double>(nodes.size() - 1);
      nodes[i] = (1.0 - w) * first + w * last;
    }
  }
  return fitted;
}

std::size_t nearest_node(std::span<const double> nodes, double q) {
  const auto nearer = [&](double a, double b) { return std::abs(a - q) < std::abs(b - q); };
  return static_cast<std::size_t>(std::min_element(nodes.begin(), nodes.end(), nearer) -
                                  nodes.begin());
}

/// The correction c at each place for a direction of travel.
Result<std::vector<Vector3>> corrections(const VolumetricModel& model, const Vector3& tool_m,
                                         std::span<const LatticePlace> places,
                                         const AxisTravel& travel) {
  std::vector<Vector3> c_m;
  c_m.reserve(places.size());
  for (const LatticePlace& place : places) {
    const auto found = model.command_correction(place.p_m, tool_m, travel);
    ABBE_TRY(found);
    c_m.push_back(found->c_m);
  }
  return c_m;
}

/// Half of (c for forward travel - c for backward travel) of one axis, at each place.
Result<std::vector<Vector3>> half_differences_of(const VolumetricModel& model,
                                                 const Vector3& tool_m,
                                                 std::span<const LatticePlace> places, Axis axis) {
  AxisTravel travel{};
  travel[index(axis)] = Travel::Forward;
  auto half_m = corrections(model, tool_m, places, travel);
  if (!half_m) return half_m;
  travel[index(axis)] = Travel::Backward;
  const auto backward_m = corrections(model, tool_m, places, travel);
  if (!backward_m) return backward_m;
  for (std::size_t i = 0; i < half_m->size(); ++i) {
    (*half_m)[i] = 0.5 * ((*half_m)[i] - (*backward_m)[i]);
  }
  return half_m;
}

std::vector<double> interpolated(std::span<const double> from, std::span<const double> values,
                                 std::span<const double> to) {
  std::vector<double> out;
  for (const double q : to) out.push_back(linear_at(from, values, q));
  return out;
}

/// Fits HeldTable::half_forward: the dependence on the direction of travel of each table's own
/// axis.
Result<void> add_directions(HeldTables& held, const VolumetricModel& model, const GridAxes& fitted,
                            std::span<const LatticePlace> places) {
  for (const Axis axis : kAllAxes) {
    std::vector<ErrorMotion> own;
    for (const HeldTable& table : held.tables) {
      if (table.motion.axis == axis) own.push_back(table.motion);
    }
    const auto half_m = half_differences_of(model, held.tool_offset_m, places, axis);
    ABBE_TRY(half_m);

    const MotionFit fit(held.chain, held.tool_offset_m, own, fitted, places, std::nullopt);
    const auto values = fit.fit(*half_m);
    for (HeldTable& table : held.tables) {
      const auto at = std::find(own.begin(), own.end(), table.motion);
      if (at == own.end()) continue;
      const auto& found = values[static_cast<std::size_t>(at - own.begin())];
      table.half_forward = interpolated(fitted[index(axis)], found, held.nodes_m[index(axis)]);
    }
  }
  return {};
}

/// Slope of a straightness table that has the effect of squareness on V: (-EC0Y y + EB0Z z,
/// -EA0Z z, 0).
double squareness_slope(ErrorMotion motion, std::span<const double> squareness) {
  if (motion == ErrorMotion{Motion::X, Axis::Y}) return -squareness[2];
  if (motion == ErrorMotion{Motion::X, Axis::Z}) return squareness[1];
  if (motion == ErrorMotion{Motion::Y, Axis::Z}) return -squareness[0];
  return 0.0;
}

/// Value of a table of the model at q_m, with the model's interpolation; 0 if the model does not
/// have this table.
double model_table_at(const TableBasis& basis, std::span<const double> U, ErrorMotion motion,
                      double q_m) {
  const auto table = basis.layout().find(motion);
  if (!table) return 0.0;
  const auto weights = basis.interpolation(motion.axis).at(q_m);
  double value = 0.0;
  for (std::size_t i = 0; i < weights.count(); ++i) {
    value += weights[i] * U[table->offset + weights.first() + i];
  }
  return value;
}

}  // namespace

Vector3 HeldTables::c_m(const Vector3& p_m, const AxisTravel& travel) const {
  const auto levers = levers_m(chain, p_m, tool_offset_m);
  Vector3 c = Vector3::Zero();
  for (const HeldTable& table : tables) {
    const std::size_t a = index(table.motion.axis);
    const double q = p_m[static_cast<Eigen::Index>(a)];
    double value = linear_at(nodes_m[a], table.value, q);
    if (!table.half_forward.empty()) {
      value += static_cast<double>(travel[a]) * linear_at(nodes_m[a], table.half_forward, q);
    }
    c += value * effect(table.motion, levers[a]);
  }
  return c;
}

std::vector<ErrorMotion> positioning_motions() {
  return {{Motion::X, Axis::X}, {Motion::Y, Axis::Y}, {Motion::Z, Axis::Z}};
}

std::vector<ErrorMotion> translation_motions() {
  std::vector<ErrorMotion> motions;
  for (const Axis axis : kAllAxes) {
    for (const Motion motion : {Motion::X, Motion::Y, Motion::Z}) motions.push_back({motion, axis});
  }
  return motions;
}

Result<HeldTables> fit_tables(const VolumetricModel& model, const Vector3& tool_m,
                              std::span<const ErrorMotion> motions, const GridAxes& nodes_m,
                              bool per_direction) {
  const GridAxes fitted = fitted_nodes(nodes_m);
  const auto places = lattice_places(model.validity(), fitted);
  ABBE_TRY(places);
  const auto c_m = corrections(model, tool_m, *places, {});
  ABBE_TRY(c_m);

  std::array<std::size_t, 3> anchors{};
  for (std::size_t a = 0; a < 3; ++a) {
    anchors[a] = nearest_node(fitted[a], model.nodes()[a].reference_m);
  }

  const auto values = MotionFit(model.chain(), tool_m, motions, fitted, *places, anchors).fit(*c_m);
  HeldTables held{model.chain(), tool_m, nodes_m, {}};
  for (std::size_t m = 0; m < motions.size(); ++m) {
    const std::size_t a = index(motions[m].axis);
    held.tables.push_back({motions[m], interpolated(fitted[a], values[m], nodes_m[a]), {}});
  }

  if (per_direction && model.travel() != nullptr) {
    ABBE_TRY(add_directions(held, model, fitted, *places));
  }
  return held;
}

Result<HeldTables> tables_of_model(const VolumetricModel& model, const Vector3& tool_m,
                                   const GridAxes& nodes_m) {
  const auto* basis = model.tables();
  if (basis == nullptr) {
    const auto layout = ParameterLayout::observable_with_one_target(model.chain(), model.nodes());
    ABBE_TRY(layout);
    std::vector<ErrorMotion> motions;
    for (const Table& table : layout->tables()) motions.push_back(table.motion);
    return fit_tables(model, tool_m, motions, nodes_m, false);
  }

  const std::span<const double> U(model.U().data(), static_cast<std::size_t>(model.U().size()));
  const auto squareness = U.subspan(basis->layout().squareness_offset(), 3);
  const Vector3& squareness_from_m = basis->layout().squareness_from_m();
  HeldTables held{model.chain(), tool_m, nodes_m, {}};
  for (const Axis axis : kAllAxes) {
    for (const Motion kind : kAllMotions) {
      const ErrorMotion motion{kind, axis};
      HeldTable table{motion, {}, {}};
      for (const double q : nodes_m[index(axis)]) {
        table.value.push_back(-model_table_at(*basis, U, motion, q) -
                              squareness_slope(motion, squareness) *
                                  (q - squareness_from_m(static_cast<Eigen::Index>(index(axis)))));
      }
      held.tables.push_back(std::move(table));
    }
  }
  return held;
}

}  // namespace abbe::calib

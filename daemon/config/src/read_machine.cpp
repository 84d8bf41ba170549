#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/calib/geometry/kinematic_chain.hpp"
#include "abbe/calib/geometry/parameter_layout.hpp"
#include "abbe/config/calibration_input.hpp"
#include "message_bounds.hpp"
#include "plausible.hpp"
#include "readers.hpp"

namespace abbe::daemon {

namespace {

constexpr double kDefaultNodeSpacing_m = 0.05;  // the spacing of [Sanders 2023]
// largest difference between the end node and the end of travel
constexpr double kNodeTolerance_m = 1e-9;

void read_axis(ClassifiedSection axis, const std::string& name, std::vector<AxisConfig>& out) {
  AxisConfig config;
  config.name = name;
  axis.get_word<AxisKind>(reading("kind"), config.kind,
                          {{"linear", AxisKind::Linear}, {"rotary", AxisKind::Rotary}});
  const bool linear = config.kind == AxisKind::Linear;
  const char* const min_key = linear ? "min_mm" : "min_rad";
  const char* const max_key = linear ? "max_mm" : "max_rad";
  const char* const reference_key = linear ? "reference_mm" : "reference_rad";
  const Unit unit = linear ? kMilli : kPlain;
  const bool has_min = axis.get(reading(min_key), config.min, unit, kAny, Need::Required);
  const bool has_max = axis.get(reading(max_key), config.max, unit, kAny, Need::Required);
  const bool has_range = has_min && has_max;

  if (has_range && config.min >= config.max)
    axis.fault(max_key, fmt::format("must exceed {}", min_key));
  if (has_range) check_travel_length(axis, max_key, config);
  config.reference = config.min <= 0.0 && config.max >= 0.0 ? 0.0 : config.min;
  const bool has_reference = axis.get(reading(reference_key), config.reference, unit, kAny);
  if (has_reference && has_range &&
      (config.reference < config.min || config.reference > config.max))
    axis.fault(reference_key, "must lie within the range of the axis");
  axis.close();
  out.push_back(std::move(config));
}

void sort_axes(std::vector<AxisConfig>& axes) {
  const auto further = [](const AxisConfig& a) {
    return a.name != "X" && a.name != "Y" && a.name != "Z";
  };
  std::stable_sort(axes.begin(), axes.end(), [&further](const AxisConfig& a, const AxisConfig& b) {
    return std::tuple{further(a), a.kind, a.name} < std::tuple{further(b), b.kind, b.name};
  });
}

void read_axes(ClassifiedSection axes, MachineConfig& out) {
  for (const auto& name : axes.keys()) read_axis(axes.child(name), name, out.axes);
  if (axes.present())
    for (const std::string_view needed : {"X", "Y", "Z"})
      if (!axes.has(needed)) axes.fault("", fmt::format("axis {} is missing", needed));
  sort_axes(out.axes);
}

/// Reads [model] node_spacing_mm for one axis. The key is one number for all axes, or a table with
/// one number per axis.
double read_spacing(ClassifiedSection& model, ClassifiedSection* per_axis,
                    const std::string& axis) {
  double spacing_m = kDefaultNodeSpacing_m;
  if (per_axis != nullptr)
    per_axis->get(stated(axis), spacing_m, kMilli, kPositive);
  else
    model.get(stated("node_spacing_mm"), spacing_m, kMilli, kPositive);
  return spacing_m;
}

void check_nodes(ClassifiedSection& nodes, const AxisConfig& axis,
                 const std::vector<double>& nodes_m) {
  const bool ascending =
      std::adjacent_find(nodes_m.begin(), nodes_m.end(), std::greater_equal<>{}) == nodes_m.end();
  if (nodes_m.size() < 2 || !ascending)
    nodes.fault(axis.name, "needs at least two nodes, strictly ascending");
  else if (std::abs(nodes_m.front() - axis.min) > kNodeTolerance_m ||
           std::abs(nodes_m.back() - axis.max) > kNodeTolerance_m)
    nodes.fault(axis.name,
                fmt::format("first and last node must be the ends of the travel, {} and {} mm",
                            axis.min * kMilli.per_si, axis.max * kMilli.per_si));
}

void read_axis_nodes(ClassifiedSection& model, ClassifiedSection& nodes, ClassifiedSection* spacing,
                     const AxisConfig& axis, MachineConfig& out) {
  const double spacing_m = read_spacing(model, spacing, axis.name);
  auto& nodes_m = out.nodes_m[axis.name];
  if (nodes.get(stated(axis.name), nodes_m, kMilli)) {
    check_nodes(nodes, axis, nodes_m);
    return;
  }

  // More nodes than this cannot be identified. The limit also prevents that a typing error
  // allocates gigabytes.
  constexpr double kMaxNodes = 2000.0;
  if ((axis.max - axis.min) / spacing_m > kMaxNodes)
    model.fault("node_spacing_mm",
                fmt::format("more than {} nodes on axis {}", kMaxNodes, axis.name));
  else if (const auto equidistant = calib::equidistant_nodes(axis.min, axis.max, spacing_m))
    nodes_m = equidistant->nodes_m;
}

void check_cubic_nodes(ClassifiedSection& model, const MachineConfig& config) {
  if (config.interpolation == TableInterpolation::Linear) return;
  constexpr std::size_t kMost = calib::AxisInterpolation::kMostCubicNodes;
  for (const auto& [axis, nodes_m] : config.nodes_m)
    if (nodes_m.size() > kMost)
      model.fault("basis", fmt::format("axis {} has {} nodes, cubic tables have at most {}", axis,
                                       nodes_m.size(), kMost));
}

void read_model(ClassifiedSection model, const toml::node* spacing_node, MachineConfig& out) {
  model.get_word<TableInterpolation>(
      operation("basis"), out.interpolation,
      {{calib::kLinearBasis, TableInterpolation::Linear},
       {calib::kCubicBasis, TableInterpolation::NaturalCubic},
       {calib::kNotAKnotCubicBasis, TableInterpolation::NotAKnotCubic}});
  ClassifiedSection nodes = model.child("nodes_mm");
  std::optional<ClassifiedSection> spacing;
  if (spacing_node != nullptr && spacing_node->is_table()) spacing = model.child("node_spacing_mm");
  for (const auto& axis : out.axes)
    if (axis.kind == AxisKind::Linear && axis.min < axis.max)
      read_axis_nodes(model, nodes, spacing ? &*spacing : nullptr, axis, out);
  for (const auto& [axis, nodes_m] : out.nodes_m)
    model.state(Role::Reading, "nodes_mm." + axis, numbers_text(nodes_m, kMilli.per_si));
  nodes.close();
  if (spacing) spacing->close();
  check_cubic_nodes(model, out);
  model.close();
}

/// Adds a fault if the model has too many parameters. A configuration that otf_machine() does not
/// accept is skipped, because its faults are reported elsewhere.
void check_model_size(ClassifiedSection& model, const MachineConfig& config) {
  const auto machine = otf_machine(config);
  if (!machine) return;
  const auto layout =
      calib::ParameterLayout::observable_with_one_target(machine->chain, machine->nodes);
  const std::size_t most = bound_of<v1::ErrorModel>("parameters");
  if (layout && layout->model_size() > most)
    model.fault("node_spacing_mm",
                fmt::format("makes a model of {} parameters; at most {} can be published",
                            layout->model_size(), most));
}

}  // namespace

const AxisConfig* MachineConfig::find_axis(std::string_view axis_name) const noexcept {
  const auto found =
      std::find_if(axes.begin(), axes.end(), [&](const auto& a) { return a.name == axis_name; });
  return found == axes.end() ? nullptr : &*found;
}

void read_machine(ClassifiedSection& root, MachineConfig& out) {
  ClassifiedSection machine = root.child("machine", Need::Required);
  if (machine.present()) {
    get_bounded(machine, reading("name"), out.name, bound_of<v1::Snapshot>("machine"),
                Need::Required);
    if (get_bounded(machine, reading("chain"), out.chain, bound_of<v1::ErrorModel>("chain"),
                    Need::Required))
      if (const auto chain = calib::KinematicChain::parse(out.chain); !chain)
        machine.fault("chain", chain.error().text);
    machine.close();
  }
  read_axes(root.child("axes", Need::Required), out);

  ClassifiedSection target = root.child("target");
  // all three elements are set, so that a missing offset and a stated offset of 0 give the same
  // machine
  std::vector<double> offset_m(3, 0.0);
  if (target.get(reading("offset_mm"), offset_m, kMilli)) {
    out.target_given = offset_m.size() == 3;
    if (out.target_given)
      std::copy(offset_m.begin(), offset_m.end(), out.target_offset_m.begin());
    else
      target.fault("offset_mm", "must be three numbers, x, y, z");
  }
  target.close();

  ClassifiedSection model = root.child("model");
  read_model(model, model.node(stated("node_spacing_mm")), out);
  check_model_size(model, out);
}

}  // namespace abbe::daemon

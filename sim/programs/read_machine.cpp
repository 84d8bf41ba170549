#include "read_machine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "read_axis_lines.hpp"
#include "read_counter_card.hpp"
#include "read_measuring_machine.hpp"
#include "read_tracker.hpp"

namespace abbe::sim {

bool is_rotary(Section root, const std::string& name) {
  std::string kind;
  Section axis = root.child("axes").child(name);
  return axis.present() && axis.get("kind", kind) && kind == "rotary";
}

namespace {

void read_axes(Section root, TruthMachine& truth) {
  Section axes = root.child("axes");
  if (!axes.present()) return root.fault("axes", "missing");
  for (const Axis axis : kAxes) {
    const std::string_view name = kAxisLetters.substr(static_cast<std::size_t>(axis), 1);
    Section section = axes.child(name);
    AxisRange& range = truth.axis(axis).range;
    const bool has_min = section.get("min_mm", range.min_m, kMilli, kAnyNumber);
    const bool has_max = section.get("max_mm", range.max_m, kMilli, kAnyNumber);
    if (!has_min || !has_max) {
      section.fault("", "needs min_mm and max_mm");
    } else if (range.min_m >= range.max_m) {
      section.fault("max_mm", "must exceed min_mm");
    }
    range.reference_m = range.min_m <= 0.0 && range.max_m >= 0.0 ? 0.0 : range.min_m;
    section.get("reference_mm", range.reference_m, kMilli, kAnyNumber);
  }
}

void read_linear_scale(Section& section, EncoderNodeOptions& node) {
  double step_nm = 1.0;  // default value, as abbed reads the file
  section.get("step_nm", step_nm, kPlain, {1.0, 1e9});
  section.get("offset_mm", node.offset, kMilli, kAnyNumber);
  node.step_nm = static_cast<std::uint32_t>(step_nm);
  if (step_nm != node.step_nm)
    section.fault("step_nm", "must be a whole number: object 6005h has no fractions");
}

void read_rotary_scale(Section& section, EncoderNodeOptions& node) {
  double step_nrad = 0.0;
  if (section.get("step_nrad", step_nrad, kPlain, {2.0, 1e9}, Need::Required))
    node.units_per_revolution =
        static_cast<std::uint32_t>(std::lround(2e9 * std::numbers::pi / step_nrad));
  section.get("offset_rad", node.offset, kPlain, kAnyNumber);
}

std::optional<EncoderNodeOptions> read_encoder_node(Section root, Section& section) {
  EncoderNodeOptions node;
  std::string name;
  section.get("axis", name);

  if (const auto axis = axis_named(name)) {
    node.axis = *axis;
    read_linear_scale(section, node);
  } else if (is_rotary(root, name)) {
    node.axis = RotarySwing{};
    read_rotary_scale(section, node);
  } else {
    section.fault("axis", "must be X, Y, Z or an axis with kind = \"rotary\" in [axes]");
    return std::nullopt;
  }

  node.node = 0;
  section.get_integer("node", node.node, 1, can::kMaxNodeId, Need::Required);
  section.get("invert", node.invert);

  return node;
}

/// Adds the nodes of X, Y and Z, and one for each rotary axis. They exist without an entry in the
/// file.
void add_rotary_nodes(Section root, std::vector<EncoderNodeOptions>& nodes) {
  for (const std::string& name : root.child("axes").keys()) {
    if (!is_rotary(root, name)) continue;
    EncoderNodeOptions node;
    node.node = static_cast<can::NodeId>(nodes.size() + 1);
    node.axis = RotarySwing{};
    nodes.push_back(node);
  }
}

void read_encoder_nodes(Section root, Section& encoder, std::vector<EncoderNodeOptions>& nodes) {
  std::vector<EncoderNodeOptions> seen;
  for (Section& section : encoder.children("nodes"))
    if (const auto node = read_encoder_node(root, section)) {
      if (node->node != 0 && std::ranges::count(seen, node->node, &EncoderNodeOptions::node) > 0)
        section.fault("node", fmt::format("node id {} is used twice", node->node));
      seen.push_back(*node);
    }
  if (seen.empty()) return add_rotary_nodes(root, nodes);
  nodes = seen;
}

/// Reads the SYNC. With sync = "external" the control of the machine sends it; here the simulator
/// does.
void read_sync(Section& encoder, SimulationSetup& simulation) {
  std::string sync;
  encoder.get("sync", sync);
  double period_us = 1000.0;
  encoder.get("sync_period_us", period_us, kPlain, {100.0, 1e6});
  if (sync == "external") simulation.sync_period = seconds_to_ns(period_us * 1e-6);
}

void read_chain(Section root, TruthMachine& truth) {
  Section machine = root.child("machine");
  std::string chain = "[w X b Y Z t]";
  machine.get("chain", chain, Need::Required);
  if (const auto order = parse_chain(chain)) {
    truth.order = *order;
  } else {
    machine.fault("chain", order.error().text);
  }
}

}  // namespace

void read_machine_tables(Section root, SetupDraft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  read_chain(root, simulation.truth);
  read_axes(root, simulation.truth);
  Section target = root.child("target");
  get_vector(target, "offset_mm", simulation.truth.target_offset_m, kMilli);
  Section tracker = root.child("tracker");
  tracker.get("sigma_range_um", simulation.tracker->model.sigma_range_m, kMicro,
              kNotNegativeNumber);
  tracker.get("sigma_angle_urad", simulation.tracker->model.sigma_angle_rad, kMicro,
              kNotNegativeNumber);
  get_port(tracker, "port", simulation.tracker_port);
  read_lines(tracker, simulation);
  read_nests(tracker, simulation);
  Section encoder = root.child("encoder");
  get_port(encoder, "peer_port", simulation.bus->port);
  get_port(encoder, "local_port", simulation.bus->peer_port);
  encoder.get_maybe_empty("interface", simulation.bus->interface);
  read_sync(encoder, simulation);
  read_encoder_nodes(root, encoder, simulation.nodes);
  read_axis_lines(root, simulation);
  read_counter_card(root.child("counter_card"), simulation);
  read_reference(root.child("reference"), simulation);
  read_cmm(root.child("cmm"), simulation);
  root.child("daemon").get("speed", draft.setup.speed, kPlain, {1e-3, 1e4});
}

}  // namespace abbe::sim

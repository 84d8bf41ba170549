#include "read_machine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "read_counter_card.hpp"
#include "read_measuring_machine.hpp"
#include "read_tracker.hpp"

namespace abbe::sim {
namespace {

void read_axes(TomlSection root, TruthMachine& truth) {
  TomlSection axes = root.child("axes");
  if (!axes.present()) return root.fault("axes", "missing");
  for (const Axis axis : kAxes) {
    const std::string_view name = kAxisLetters.substr(static_cast<std::size_t>(axis), 1);
    TomlSection section = axes.child(name);
    AxisRange& range = truth.axis(axis).range;
    const bool has_min = section.number("min_mm", range.min_m, kMilli);
    const bool has_max = section.number("max_mm", range.max_m, kMilli);
    if (!has_min || !has_max) {
      section.fault("", "needs min_mm and max_mm");
    } else if (range.min_m >= range.max_m) {
      section.fault("max_mm", "must exceed min_mm");
    }
    range.reference_m = range.min_m <= 0.0 && range.max_m >= 0.0 ? 0.0 : range.min_m;
    section.number("reference_mm", range.reference_m, kMilli);
  }
}

void read_linear_scale(TomlSection& section, EncoderNodeOptions& node) {
  double step_nm = 1.0;  // as abbed reads the file
  section.number("step_nm", step_nm, 1.0, {1.0, 1e9});
  section.number("offset_mm", node.offset, kMilli);
  node.step_nm = static_cast<std::uint32_t>(step_nm);
  if (step_nm != node.step_nm)
    section.fault("step_nm", "must be a whole number: object 6005h has no fractions");
}

void read_rotary_scale(TomlSection& section, EncoderNodeOptions& node) {
  double step_nrad = 0.0;
  if (section.number("step_nrad", step_nrad, 1.0, {2.0, 1e9}))
    node.units_per_revolution =
        static_cast<std::uint32_t>(std::lround(2e9 * std::numbers::pi / step_nrad));
  else
    section.fault("step_nrad", "missing, or not a number from 2 to 1e9");
  section.number("offset_rad", node.offset, 1.0);
}

bool is_rotary(TomlSection root, const std::string& name) {
  std::string kind;
  TomlSection axis = root.child("axes").child(name);
  return axis.present() && axis.text("kind", kind) && kind == "rotary";
}

std::optional<EncoderNodeOptions> read_encoder_node(TomlSection root, TomlSection& section) {
  EncoderNodeOptions node;
  std::string name;
  std::int64_t id = 0;
  section.text("axis", name);

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

  if (!section.integer("node", id, 1, can::kMaxNodeId)) section.fault("node", "missing");
  section.flag("invert", node.invert);
  node.node = static_cast<can::NodeId>(id);

  return node;
}

/// Those of X, Y and Z, and one on each rotary axis: they exist without an entry in the file.
void add_rotary_nodes(TomlSection root, std::vector<EncoderNodeOptions>& nodes) {
  for (const std::string& name : root.child("axes").keys()) {
    if (!is_rotary(root, name)) continue;
    EncoderNodeOptions node;
    node.node = static_cast<can::NodeId>(nodes.size() + 1);
    node.axis = RotarySwing{};
    nodes.push_back(node);
  }
}

void read_encoder_nodes(TomlSection root, TomlSection& encoder,
                        std::vector<EncoderNodeOptions>& nodes) {
  std::vector<EncoderNodeOptions> seen;
  for (TomlSection& section : encoder.children("nodes"))
    if (const auto node = read_encoder_node(root, section)) {
      if (node->node != 0 && std::ranges::count(seen, node->node, &EncoderNodeOptions::node) > 0)
        section.fault("node", fmt::format("node id {} is used twice", node->node));
      seen.push_back(*node);
    }
  if (seen.empty()) return add_rotary_nodes(root, nodes);
  nodes = seen;
}

/// With sync = "external" the control of the machine sends the SYNC; the simulator does it.
void read_sync(TomlSection& encoder, SimulationSetup& simulation) {
  std::string sync;
  encoder.text("sync", sync);
  double period_us = 1000.0;
  encoder.number("sync_period_us", period_us, 1.0, {100.0, 1e6});
  if (sync == "external") simulation.sync_period = seconds_to_ns(period_us * 1e-6);
}

void read_chain(TomlSection root, TruthMachine& truth) {
  TomlSection machine = root.child("machine");
  std::string chain = "[w X b Y Z t]";
  if (!machine.text("chain", chain)) root.fault("machine.chain", "missing");
  if (const auto order = parse_chain(chain)) {
    truth.order = *order;
  } else {
    machine.fault("chain", order.error().text);
  }
}

}  // namespace

void read_machine_tables(TomlSection root, SetupDraft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  read_chain(root, simulation.truth);
  read_axes(root, simulation.truth);
  root.child("target").vector("offset_mm", simulation.truth.target_offset_m, kMilli);
  TomlSection tracker = root.child("tracker");
  tracker.number("sigma_range_um", simulation.tracker->model.sigma_range_m, kMicro,
                 kNotNegativeNumber);
  tracker.number("sigma_angle_urad", simulation.tracker->model.sigma_angle_rad, kMicro,
                 kNotNegativeNumber);
  tracker.port("port", simulation.tracker_port);
  read_nests(tracker, simulation);
  TomlSection encoder = root.child("encoder");
  encoder.port("peer_port", simulation.bus->port);
  encoder.port("local_port", simulation.bus->peer_port);
  encoder.text("interface", simulation.bus->interface);
  read_sync(encoder, simulation);
  read_encoder_nodes(root, encoder, simulation.nodes);
  read_counter_card(root.child("counter_card"), simulation);
  read_reference(root.child("reference"), simulation);
  read_cmm(root.child("cmm"), simulation);
  root.child("daemon").number("speed", draft.setup.speed, 1.0, {1e-3, 1e4});
}

}  // namespace abbe::sim

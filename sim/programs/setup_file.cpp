#include "setup_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "abbe/sim/random_truth.hpp"
#include "abbe/sim/truth_table.hpp"
#include "environment_setup.hpp"
#include "files.hpp"
#include "measuring_machine_setup.hpp"
#include "toml_section.hpp"

namespace abbe::sim {
namespace {

constexpr double kFeed = 1e-3 / 60.0;  // mm/min in m/s
constexpr std::int64_t kLastNode = 127;

/// Everything the files say, before the truth is made of it.
struct Draft {
  LoadedSetup setup;
  RandomTruthOptions random;
  std::string truth_file;
  std::string path_file;
  std::string machine_file;
  std::string artefact_file;
  std::int64_t seed = 1;
  double encoder_noise_m = 5e-9;
};

std::string beside(const std::string& file, const std::string& path) {
  return (std::filesystem::path(file).parent_path() / path).string();
}

void read_duration(TomlSection& section, std::string_view key, std::chrono::nanoseconds& value,
                   double scale) {
  double seconds = 0.0;
  if (section.number(key, seconds, scale, kNotNegativeNumber)) value = seconds_to_ns(seconds);
}

void read_port(TomlSection& section, std::string_view key, std::uint16_t& port) {
  std::int64_t value = 0;
  if (section.integer(key, value, 0, kLastPort)) port = static_cast<std::uint16_t>(value);
}

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

void read_encoder_nodes(TomlSection& encoder, std::vector<EncoderNodeOptions>& nodes) {
  std::vector<EncoderNodeOptions> seen;
  for (TomlSection& section : encoder.children("nodes")) {
    EncoderNodeOptions node;
    std::string name;
    std::int64_t id = 0;
    double step_nm = 10.0;
    section.text("axis", name);
    const std::size_t axis = name.size() == 1 ? kAxisLetters.find(name[0]) : std::string_view::npos;
    if (axis == std::string_view::npos) {
      section.fault("axis", "must be X, Y or Z");
      continue;
    }
    if (!section.integer("node", id, 1, kLastNode)) section.fault("node", "missing");
    section.number("step_nm", step_nm, 1.0, {1.0, 1e9});
    section.number("offset_mm", node.offset_m, kMilli);
    section.flag("invert", node.invert);
    node.axis = kAxes[axis];
    node.node = static_cast<can::NodeId>(id);
    node.step_nm = static_cast<std::uint32_t>(step_nm);
    seen.push_back(node);
  }
  if (!seen.empty()) nodes = seen;
}

std::optional<std::uint8_t> read_channel(TomlSection& section, std::string_view key) {
  std::int64_t channel = 0;
  if (!section.integer(key, channel, 0, static_cast<std::int64_t>(quad08::kChannels) - 1))
    return std::nullopt;
  return static_cast<std::uint8_t>(channel);
}

CardAxis read_card_axis(TomlSection& section) {
  CardAxis axis;
  section.text("axis", axis.name);
  axis.channel = read_channel(section, "channel").value_or(0);
  section.number("step_nm", axis.step, 1e-9, kPositiveNumber);
  section.number("step_nrad", axis.step, 1e-9, kPositiveNumber);
  bool invert = false;
  section.flag("invert", invert);
  if (invert) axis.step = -axis.step;
  return axis;
}

/// What hangs on any card: its address and its clock.
CounterCardSetup read_card(TomlSection& section) {
  CounterCardSetup card;
  read_port(section, "port", card.port);
  section.text("serial_number", card.serial);
  std::string source = "external";
  section.text("clock_source", source);
  card.own_timer = source == "timer0";
  section.number("clock_MHz", card.clock_hz, 1e6, kPositiveNumber);
  card.clock_channel = read_channel(section, "clock_channel").value_or(card.clock_channel);
  card.latch_channel = read_channel(section, "latch_channel");
  card.edge_channel = read_channel(section, "edge_channel");
  return card;
}

/// The daemon's [counter_card]: its wiring is the card's.
void read_counter_card(TomlSection section, SimulationSetup& simulation) {
  if (!section.present()) return;
  CounterCardSetup card = read_card(section);
  for (TomlSection& axis : section.children("axes")) card.axes.push_back(read_card_axis(axis));
  simulation.counter_cards.push_back(card);
}

/// A scale of [counter_card] once more, with its marks.
CardAxis read_marked_axis(TomlSection& section, const CounterCardSetup& live) {
  CardAxis axis;
  std::string name;
  section.text("axis", name);
  const auto counted = std::ranges::find(live.axes, name, &CardAxis::name);
  if (counted == live.axes.end()) {
    section.fault("axis", "is not counted by [counter_card]");
    return axis;
  }
  axis = *counted;
  axis.channel = read_channel(section, "channel").value_or(0);
  std::int64_t increment = axis.nominal_increment;
  double length = 0.0;
  section.number("signal_period_um", axis.signal_period, kMicro, kPositiveNumber);
  section.number("length_mm", length, kMilli, kPositiveNumber);
  section.number("zero_mark_mm", axis.marks_zero, kMilli);
  section.integer("increment", increment, 2, 1'000'000);
  axis.nominal_increment = static_cast<int>(increment);
  if (axis.signal_period > 0.0)
    axis.mark_pairs = static_cast<int>(length / (axis.signal_period * static_cast<double>(increment)));
  return axis;
}

/// The daemon's [reference]: a second card on the same scales, with their marks.
void read_reference(TomlSection section, SimulationSetup& simulation) {
  if (!section.present()) return;
  if (simulation.counter_cards.empty()) return section.fault("", "there is no [counter_card]");
  CounterCardSetup card = read_card(section);
  const CounterCardSetup& live = simulation.counter_cards.front();
  for (TomlSection& axis : section.children("axes")) card.axes.push_back(read_marked_axis(axis, live));
  simulation.counter_cards.push_back(card);
}

/// [sim.counter_card]: what the daemon cannot know of it.
void read_sim_counter_card(TomlSection section, SimulationSetup& simulation) {
  if (!section.present()) return;
  if (simulation.counter_cards.empty())
    return section.fault("", "there is no [counter_card] in the machine file");
  CounterCardSetup& card = simulation.counter_cards.front();
  double noise_m = 0.0;
  double fifo_bytes = static_cast<double>(card.fifo_bytes);
  read_port(section, "port", card.port);
  section.text("serial_number", card.serial);
  section.number("noise_nm", noise_m, 1e-9, kNotNegativeNumber);
  section.number("clock_deviation_ppm", card.clock_deviation_ppm, 1.0, {-1000.0, 1000.0});
  section.number("fifo_kB", fifo_bytes, 1e3, {1.0, 1e6});
  card.fifo_bytes = static_cast<std::size_t>(fifo_bytes);
  for (CardAxis& axis : card.axes) axis.noise = noise_m;
  section.refuse_unknown_keys();
}

void read_probe(TomlSection section, SimulationSetup& simulation) {
  if (!section.present()) return;
  TouchedSurface surface;
  std::string axis = "Z";
  section.text("axis", axis);
  const auto place = axis.size() == 1 ? kAxisLetters.find(axis[0]) : std::string_view::npos;
  if (place == std::string_view::npos) section.fault("axis", "must be X, Y or Z");
  surface.axis = static_cast<int>(place == std::string_view::npos ? 2 : place);
  if (!section.number("surface_mm", surface.surface_m, kMilli)) section.fault("surface_mm", "missing");
  section.number("delay_us", surface.delay_s, kMicro, kNotNegativeNumber);
  section.number("jitter_us", surface.jitter_s, kMicro, kNotNegativeNumber);
  section.refuse_unknown_keys();
  simulation.surface = surface;
}

void read_count(TomlSection& section, std::string_view key, std::size_t& value) {
  constexpr std::int64_t kMost = 1000;
  std::int64_t count = 0;
  if (section.integer(key, count, 1, kMost)) value = static_cast<std::size_t>(count);
}

/// What abbe-sim evemu plays.
void read_sim_evemu(TomlSection section, LoadedSetup& setup) {
  TouchingOptions& touching = setup.touching;
  read_count(section, "points_per_ball", touching.points_per_ball);
  read_count(section, "points_per_block", touching.points_per_block);
  section.number("probing_mm_per_s", touching.probing_m_per_s, kMilli, kPositiveNumber);
  section.number("travel_mm_per_s", touching.travel_m_per_s, kMilli, kPositiveNumber);
  section.number("noise_um", touching.noise_m, kMicro, kNotNegativeNumber);
  section.number("delay_us", touching.delay_s, kMicro, kNotNegativeNumber);
  section.number("jitter_us", touching.jitter_s, kMicro, kNotNegativeNumber);
  section.number("sag_um", setup.weak_stiffness.sag_m, kMicro);
  section.number("periodic_um", setup.weak_stiffness.periodic_m, kMicro);
  section.number("period_mm", setup.weak_stiffness.period_m, kMilli, kPositiveNumber);
  section.refuse_unknown_keys();
}

/// The array that is touched then, against what its calibrator.toml says.
void read_ball_array(TomlSection section, ArrayState& array) {
  section.number("temperature_C", array.temperature_C, 1.0, {-50.0, 100.0});
  section.number("alpha_um_per_m_K", array.alpha_per_K, kMicro, {-50.0, 50.0});
  section.number("u_alpha_um_per_m_K", array.u_alpha_per_K, kMicro, {0.0, 50.0});
  section.number("u_ball_um", array.u_ball_m, kMicro, kNotNegativeNumber);
  section.number("u_block_urad", array.u_block_rad, kMicro, kNotNegativeNumber);
  section.refuse_unknown_keys();
}

/// The tables the daemon reads too. Keys that only it knows are none of ours.
void read_machine_tables(TomlSection root, Draft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  TomlSection machine = root.child("machine");
  std::string chain = "[w X b Y Z t]";
  if (!machine.text("chain", chain)) root.fault("machine.chain", "missing");
  if (const auto order = parse_chain(chain)) {
    simulation.truth.order = *order;
  } else {
    machine.fault("chain", order.error().text);
  }
  read_axes(root, simulation.truth);
  root.child("target").vector("offset_mm", simulation.truth.target_offset_m, kMilli);
  TomlSection tracker = root.child("tracker");
  tracker.number("sigma_range_um", simulation.tracker->model.sigma_range_m, kMicro, kNotNegativeNumber);
  tracker.number("sigma_angle_urad", simulation.tracker->model.sigma_angle_rad, kMicro, kNotNegativeNumber);
  read_port(tracker, "port", simulation.tracker_port);
  TomlSection encoder = root.child("encoder");
  read_port(encoder, "peer_port", simulation.bus->port);
  read_port(encoder, "local_port", simulation.bus->peer_port);
  encoder.text("interface", simulation.bus->interface);
  read_encoder_nodes(encoder, simulation.nodes);
  read_counter_card(root.child("counter_card"), simulation);
  read_reference(root.child("reference"), simulation);
  read_cmm(root.child("cmm"), simulation);
  root.child("daemon").number("speed", draft.setup.speed, 1.0, {1e-3, 1e4});
}

void read_truth(TomlSection section, const std::string& file, Draft& draft) {
  std::string shape = "linear";
  section.number("mean_error_um", draft.random.mean_error_m, kMicro, kPositiveNumber);
  section.number("node_spacing_mm", draft.random.node_spacing_m, kMilli, {0.1, 1e6});
  section.number("backlash_um", draft.random.backlash_m, kMicro, kNotNegativeNumber);
  section.text("shape", shape);
  if (shape != "linear" && shape != "cubic") section.fault("shape", "must be \"linear\" or \"cubic\"");
  draft.random.shape = shape == "cubic" ? Shape::Cubic : Shape::Linear;
  std::string path;
  if (section.text("file", path)) draft.truth_file = beside(file, path);
  section.refuse_unknown_keys();
}

void read_thermal(TomlSection section, ThermalDrift& thermal) {
  section.vector("growth_um_per_m", thermal.growth_per_m, kMicro);
  section.vector("shift_um", thermal.shift_m, kMicro);
  section.number("time_constant_s", thermal.time_constant_s, 1.0, kPositiveNumber);
  section.refuse_unknown_keys();
}

void read_path(TomlSection section, const std::string& file, Draft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  std::string path;
  if (section.text("file", path)) draft.path_file = beside(file, path);
  section.number("feed_mm_per_min", simulation.path.feed_m_per_s, kFeed, kPositiveNumber);
  section.number("acceleration_mm_per_s2", simulation.path.acceleration_m_per_s2, kMilli, kPositiveNumber);
  section.number("dwell_s", simulation.path.dwell_s, 1.0, kNotNegativeNumber);
  read_duration(section, "standstill_s", simulation.standstill, 1.0);
  section.flag("start_when_streaming", simulation.start_when_streaming);
  section.refuse_unknown_keys();
}

void read_tracker(TomlSection section, SimulationSetup& simulation) {
  TrackerOptions& tracker = *simulation.tracker;
  TrackerModel& model = tracker.model;
  read_port(section, "port", simulation.tracker_port);
  section.vector("position_mm", model.position_m, kMilli);
  section.vector("rotation_rad", model.rotation_rad);
  section.number("sigma_range_um", model.sigma_range_m, kMicro, kNotNegativeNumber);
  section.number("sigma_angle_urad", model.sigma_angle_rad, kMicro, kNotNegativeNumber);
  section.number("max_radial_speed_mm_per_s", model.max_radial_speed_m_per_s, kMilli, kPositiveNumber);
  section.number("max_lateral_speed_mm_per_s", model.max_lateral_speed_m_per_s, kMilli, kPositiveNumber);
  section.number("clock_offset_s", model.clock_offset_s, 1.0, {0.0, 2e9});
  section.number("clock_drift_ppm", model.clock_drift_ppm, 1.0, {-1000.0, 1000.0});
  read_duration(section, "delay_ms", tracker.delay, kMilli);
  read_duration(section, "warm_up_s", tracker.warm_up, 1.0);
  read_duration(section, "command_latency_ms", tracker.command_latency, kMilli);
  read_duration(section, "initialize_s", tracker.initialize_time, 1.0);
  section.number("air_temperature_C", tracker.air_temperature_C);
  section.number("air_pressure_mbar", tracker.air_pressure_mbar);
  section.number("air_humidity_percent", tracker.air_humidity_percent);
  section.number("air_drift_K_per_hour", tracker.air_drift_K_per_hour);
  section.refuse_unknown_keys();
}

void read_faults(TomlSection& sim, std::vector<ScheduledFault>& faults) {
  for (TomlSection& section : sim.children("fault")) {
    ScheduledFault scheduled;
    std::string device, kind;
    std::int64_t node = 0;
    section.text("device", device);
    section.text("kind", kind);
    if (device == "tracker") {
      scheduled.target = FaultTarget::Tracker;
    } else if (device == "encoder") {
      scheduled.target = FaultTarget::Encoder;
    } else if (device == "environment") {
      scheduled.target = FaultTarget::Environment;
    } else if (device == "counter_card") {
      scheduled.target = FaultTarget::CounterCard;
    } else if (device == "cmm") {
      scheduled.target = FaultTarget::MeasuringMachine;
    } else {
      section.fault("device",
                    "must be \"tracker\", \"encoder\", \"environment\", \"counter_card\" or \"cmm\"");
    }
    const auto known = fault_kind(scheduled.target, kind);
    if (!known) section.fault("kind", fmt::format("\"{}\" is no fault of this device", kind));
    scheduled.fault.kind = known.value_or(FaultKind::Mute);
    if (!section.number("at_s", scheduled.fault.at_s, 1.0, kNotNegativeNumber))
      section.fault("at_s", "missing");
    section.number("duration_s", scheduled.fault.duration_s, 1.0, kNotNegativeNumber);
    section.number("value", scheduled.fault.value);
    if (section.integer("node", node, 0, kLastNode)) scheduled.fault.node = static_cast<std::uint8_t>(node);
    section.refuse_unknown_keys();
    faults.push_back(scheduled);
  }
}

void read_sim(TomlSection sim, const std::string& file, Draft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  std::string machine;
  if (sim.text("machine", machine)) draft.machine_file = beside(file, machine);
  sim.integer("seed", draft.seed, 0, INT64_MAX);
  sim.number("speed", draft.setup.speed, 1.0, {1e-3, 1e4});
  read_truth(sim.child("truth"), file, draft);
  read_thermal(sim.child("thermal"), simulation.truth.thermal);
  read_path(sim.child("path"), file, draft);
  read_tracker(sim.child("tracker"), simulation);
  TomlSection encoder = sim.child("encoder");
  read_port(encoder, "port", simulation.bus->port);
  read_port(encoder, "peer_port", simulation.bus->peer_port);
  encoder.text("interface", simulation.bus->interface);
  encoder.number("noise_nm", draft.encoder_noise_m, 1e-9, kNotNegativeNumber);
  encoder.refuse_unknown_keys();
  read_environment(sim, simulation.environment);
  read_sim_counter_card(sim.child("counter_card"), simulation);
  read_sim_evemu(sim.child("evemu"), draft.setup);
  read_ball_array(sim.child("ball_array"), draft.setup.array);
  read_probe(sim.child("probe"), simulation);
  std::string artefact;
  read_sim_cmm(sim.child("cmm"), simulation, artefact);
  if (!artefact.empty()) draft.artefact_file = beside(file, artefact);
  read_faults(sim, simulation.faults);
  sim.refuse_unknown_keys();
}

Result<toml::table> parse(const std::string& file) {
  const auto text = read_file(file);
  if (!text) return tl::unexpected(text.error());
  try {
    return toml::parse(*text, file);
  } catch (const toml::parse_error& e) {
    return bad_input(fmt::format("{}:{}: {}", file, e.source().begin.line, e.description()));
  }
}

/// Reads the parts of one file that `reader` knows.
template <class Reader>
Result<void> with_file(const std::string& file, Reader reader) {
  const auto table = parse(file);
  if (!table) return tl::unexpected(table.error());
  TomlFaults faults(file);
  reader(TomlSection(&*table, "", faults));
  if (faults.any()) return tl::unexpected(faults.error());
  return {};
}

Result<void> read_files(const SetupChoices& choices, Draft& draft) {
  // The machine file comes first although [sim] may name it: what [sim] says about a port or a speed wins.
  if (!choices.config_file.empty()) {
    const auto named = with_file(choices.config_file, [&](TomlSection root) {
      std::string machine;
      if (root.child("sim").text("machine", machine))
        draft.machine_file = beside(choices.config_file, machine);
    });
    if (!named) return named;
  }
  if (!choices.machine_file.empty()) draft.machine_file = choices.machine_file;
  if (draft.machine_file.empty()) draft.machine_file = choices.config_file;
  if (draft.machine_file.empty()) return usage_error("no machine: give --machine FILE or --config FILE");
  const std::string machine_file = draft.machine_file;
  const auto machine = with_file(machine_file, [&](TomlSection root) { read_machine_tables(root, draft); });
  if (!machine) return machine;
  if (choices.config_file.empty()) return {};
  return with_file(choices.config_file, [&](TomlSection root) {
    TomlSection sim = root.child("sim");
    if (!sim.present()) return root.fault("sim", "missing");
    read_sim(sim, choices.config_file, draft);
  });
}

void apply_choices(const SetupChoices& choices, Draft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  if (!choices.path_file.empty()) draft.path_file = choices.path_file;
  if (!choices.truth_file.empty()) draft.truth_file = choices.truth_file;
  if (choices.seed) draft.seed = static_cast<std::int64_t>(*choices.seed);
  if (choices.speed) draft.setup.speed = *choices.speed;
  if (choices.feed_mm_per_min) simulation.path.feed_m_per_s = *choices.feed_mm_per_min * kFeed;
  if (choices.tracker_port) simulation.tracker_port = *choices.tracker_port;
  if (choices.can_port) simulation.bus->port = *choices.can_port;
  if (!choices.can_interface.empty()) simulation.bus->interface = choices.can_interface;
  if (choices.can_peer_port) simulation.bus->peer_port = *choices.can_peer_port;
  if (choices.usbip_port && !simulation.counter_cards.empty())
    simulation.counter_cards.front().port = *choices.usbip_port;
  if (choices.start_when_streaming) simulation.start_when_streaming = true;
  if (choices.start_at_once) simulation.start_when_streaming = false;
}

Result<void> make_truth(Draft& draft) {
  TruthMachine& truth = draft.setup.simulation.truth;
  if (draft.truth_file.empty()) {
    draft.random.seed = static_cast<std::uint64_t>(draft.seed);
    truth = random_truth(truth, draft.random);
    return {};
  }
  const auto text = read_file(draft.truth_file);
  if (!text) return tl::unexpected(text.error());
  auto read = parse_truth_csv(*text, draft.truth_file, truth, draft.random.shape);
  if (!read) return tl::unexpected(read.error());
  truth = *read;
  return {};
}

Result<void> make_path(const Draft& draft, PathPlan& path) {
  if (draft.path_file.empty()) return usage_error("no path: give --path FILE or [sim.path] file");
  const auto text = read_file(draft.path_file);
  if (!text) return tl::unexpected(text.error());
  auto vertices = parse_path_csv(*text, draft.path_file);
  if (!vertices) return tl::unexpected(vertices.error());
  if (vertices->size() < 2) return bad_input(draft.path_file + ": a path needs at least two vertices");
  path.vertices = *vertices;
  return {};
}

void share_seed_and_speed(Draft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  simulation.tracker->model.seed = static_cast<std::uint64_t>(draft.seed);
  draft.setup.array.seed = static_cast<std::uint64_t>(draft.seed);
  simulation.bus->speed = draft.setup.speed;
  for (EncoderNodeOptions& node : simulation.nodes) {
    node.seed = static_cast<std::uint64_t>(draft.seed);
    node.noise_m = draft.encoder_noise_m;
  }
  if (simulation.measuring_machine)
    simulation.measuring_machine->machine.seed = static_cast<std::uint64_t>(draft.seed);
  if (simulation.surface) simulation.surface->seed = static_cast<std::uint64_t>(draft.seed);
  for (CounterCardSetup& card : simulation.counter_cards) card.seed = static_cast<std::uint64_t>(draft.seed);
}

}  // namespace

Result<LoadedSetup> load_setup(const SetupChoices& choices) {
  Draft draft;
  SimulationSetup& simulation = draft.setup.simulation;
  simulation.tracker.emplace();
  simulation.bus.emplace();
  for (const Axis axis : kAxes) {
    EncoderNodeOptions node;
    node.node = static_cast<can::NodeId>(static_cast<std::size_t>(axis) + 1);
    node.axis = axis;
    simulation.nodes.push_back(node);
  }
  if (const auto read = read_files(choices, draft); !read) return tl::unexpected(read.error());
  apply_choices(choices, draft);
  if (const auto made = make_truth(draft); !made) return tl::unexpected(made.error());
  if (choices.needs_path) {
    if (const auto made = make_path(draft, simulation.path); !made) return tl::unexpected(made.error());
  }
  if (!draft.artefact_file.empty()) {
    const auto read = read_artefact(draft.artefact_file, simulation.measuring_machine->machine);
    if (!read) return tl::unexpected(read.error());
  }
  share_seed_and_speed(draft);
  return draft.setup;
}

}  // namespace abbe::sim

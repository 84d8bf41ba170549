#include "setup_file.hpp"

#include "abbe/result/try.hpp"
#include "abbe/sim/truth_table.hpp"
#include "files.hpp"
#include "read_machine.hpp"
#include "read_measuring_machine.hpp"
#include "read_sim.hpp"
#include "setup_draft.hpp"
#include "toml_file.hpp"

namespace abbe::sim {
namespace {

/// Adds a tracker, and an encoder for each axis. These devices exist without an entry in the files.
void add_usual_devices(SimulationSetup& simulation) {
  simulation.tracker.emplace();
  simulation.bus.emplace();
  for (const Axis axis : kAxes) {
    EncoderNodeOptions node;
    node.node = static_cast<can::NodeId>(static_cast<std::size_t>(axis) + 1);
    node.axis = axis;
    simulation.nodes.push_back(node);
  }
}

Result<void> read_files(const SetupChoices& choices, SetupDraft& draft) {
  // The machine file is read first, although [sim] may name it: the ports and the speed in [sim]
  // override those in the machine file.
  if (!choices.config_file.empty()) {
    auto named = read_toml_file(choices.config_file, [&](Section root) {
      std::string machine;
      if (root.child("sim").get("machine", machine))
        draft.machine_file = beside_file(choices.config_file, machine);
    });
    if (!named) return named;
  }

  if (!choices.machine_file.empty()) draft.machine_file = choices.machine_file;
  if (draft.machine_file.empty()) draft.machine_file = choices.config_file;
  if (draft.machine_file.empty())
    return usage_error("no machine: give --machine FILE or --config FILE");
  const std::string machine_file = draft.machine_file;
  auto machine = read_toml_file(machine_file,
                                [&](Section root) { read_machine_tables(std::move(root), draft); });
  if (!machine) return machine;
  if (choices.config_file.empty()) return {};

  return read_toml_file(choices.config_file, [&](Section root) {
    Section sim = root.child("sim");
    if (!sim.present()) return root.fault("sim", "missing");
    read_sim(sim, choices.config_file, draft);
  });
}

void apply_choices(const SetupChoices& choices, SetupDraft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  if (!choices.path_file.empty()) draft.path_file = choices.path_file;
  if (!choices.truth_file.empty()) draft.truth_file = choices.truth_file;
  if (choices.seed) draft.seed = static_cast<std::int64_t>(*choices.seed);
  if (choices.speed) draft.setup.speed = *choices.speed;
  if (choices.dwell_s) simulation.path.dwell_s = *choices.dwell_s;
  if (choices.feed_mm_per_min)
    simulation.path.feed_m_per_s = *choices.feed_mm_per_min / kPerMinute.per_si;
  if (choices.tracker_port) simulation.tracker_port = *choices.tracker_port;
  if (choices.can_port) simulation.bus->port = *choices.can_port;
  if (!choices.can_interface.empty()) simulation.bus->interface = choices.can_interface;
  if (choices.can_peer_port) simulation.bus->peer_port = *choices.can_peer_port;
  if (choices.usbip_port && !simulation.counter_cards.empty())
    simulation.counter_cards.front().port = *choices.usbip_port;
  if (choices.start_when_streaming) simulation.start_when_streaming = true;
  if (choices.start_at_once) simulation.start_when_streaming = false;
}

Result<void> make_truth(SetupDraft& draft) {
  TruthMachine& truth = draft.setup.simulation.truth;
  if (draft.truth_file.empty()) {
    draft.random.seed = static_cast<std::uint64_t>(draft.seed);
    truth = random_truth(truth, draft.random);
    return {};
  }
  const auto text = read_file(draft.truth_file);
  ABBE_TRY(text);
  auto read = parse_truth_csv(*text, draft.truth_file, truth, draft.random.shape);
  ABBE_TRY(read);
  truth = *read;
  return {};
}

/// With a control, the machine stands in the middle of its travel until the first position arrives.
void stand_in_the_middle(SimulationSetup& simulation) {
  Eigen::Vector3d middle_m;
  for (const Axis axis : kAxes) {
    const AxisRange& range = simulation.truth.axis(axis).range;
    middle_m[static_cast<Eigen::Index>(axis)] = 0.5 * (range.min_m + range.max_m);
  }
  simulation.path.vertices = {{middle_m}};
}

/// Checks the setup of a machine that follows a control: its motion comes from the control, in real
/// time.
Result<void> check_control(const SetupDraft& draft) {
  const std::string file = "[sim.control]";
  if (!draft.path_file.empty())
    return bad_input(file + ": the machine follows the control; leave [sim.path] file out");
  if (draft.setup.speed != 1.0)
    return bad_input(file + ": a control runs in real time; speed must be 1");
  return {};
}

Result<void> make_path(const SetupDraft& draft, PathPlan& path) {
  if (draft.path_file.empty()) return usage_error("no path: give --path FILE or [sim.path] file");
  const auto text = read_file(draft.path_file);
  ABBE_TRY(text);
  auto vertices = parse_path_csv(*text, draft.path_file);
  ABBE_TRY(vertices);
  if (vertices->size() < 2)
    return bad_input(draft.path_file + ": a path needs at least two vertices");
  path.vertices = *vertices;
  return {};
}

void share_seed_and_speed(SetupDraft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  simulation.tracker->model.seed = static_cast<std::uint64_t>(draft.seed);
  draft.setup.array.seed = static_cast<std::uint64_t>(draft.seed);
  simulation.bus->speed = draft.setup.speed;

  for (EncoderNodeOptions& node : simulation.nodes) {
    node.seed = static_cast<std::uint64_t>(draft.seed);
    node.noise = draft.encoder_noise;
  }

  if (simulation.axis_lines)
    simulation.axis_lines->options.times.seed = static_cast<std::uint64_t>(draft.seed);
  if (simulation.measuring_machine)
    simulation.measuring_machine->machine.seed = static_cast<std::uint64_t>(draft.seed);
  if (simulation.surface) simulation.surface->seed = static_cast<std::uint64_t>(draft.seed);
  for (CounterCardSetup& card : simulation.counter_cards)
    card.seed = static_cast<std::uint64_t>(draft.seed);
}

/// Lets the beam of the tracker visit the nests, if there are any, while the machine waits.
void make_nest_visits(SetupDraft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  TrackerModel& tracker = simulation.tracker->model;
  const auto seed = static_cast<std::uint64_t>(draft.seed);
  tracker.drift = draft.drift_is_random_walk ? TrackerDrift::random_walk(draft.drift_at_end_m, seed)
                                             : TrackerDrift::linear(draft.drift_at_end_m);
  tracker.nests.seed = seed;
  if (!draft.nest_visits) tracker.nests.nests.clear();
  simulation.path.wait_s = tracker.nests.round_s();
}

}  // namespace

Result<LoadedSetup> load_setup(const SetupChoices& choices) {
  SetupDraft draft;
  SimulationSetup& simulation = draft.setup.simulation;
  add_usual_devices(simulation);
  ABBE_TRY(read_files(choices, draft));
  apply_choices(choices, draft);
  ABBE_TRY(make_truth(draft));

  if (simulation.control_port) {
    ABBE_TRY(check_control(draft));
    stand_in_the_middle(simulation);
  } else if (choices.needs_path) {
    ABBE_TRY(make_path(draft, simulation.path));
  }

  if (!draft.artefact_file.empty()) {
    const auto read = read_artefact(draft.artefact_file, simulation.measuring_machine->machine);
    ABBE_TRY(read);
  }

  share_seed_and_speed(draft);
  make_nest_visits(draft);
  return draft.setup;
}

}  // namespace abbe::sim

#include "read_sim.hpp"

#include <chrono>
#include <cstdint>

#include "files.hpp"
#include "read_counter_card.hpp"
#include "read_environment.hpp"
#include "read_faults.hpp"
#include "read_measuring_machine.hpp"
#include "read_touching.hpp"
#include "read_tracker.hpp"

namespace abbe::sim {
namespace {

void read_truth(TomlSection section, const std::string& file, SetupDraft& draft) {
  std::string shape = "linear";
  section.number("mean_error_um", draft.random.mean_error_m, kMicro, kPositiveNumber);
  section.number("node_spacing_mm", draft.random.node_spacing_m, kMilli, {0.1, 1e6});
  section.number("backlash_um", draft.random.backlash_m, kMicro, kNotNegativeNumber);
  section.text("shape", shape);
  if (shape != "linear" && shape != "cubic")
    section.fault("shape", "must be \"linear\" or \"cubic\"");
  draft.random.shape = shape == "cubic" ? Shape::Cubic : Shape::Linear;
  std::string path;
  if (section.text("file", path)) draft.truth_file = beside_file(file, path);
  section.refuse_unknown_keys();
}

void read_thermal(TomlSection section, ThermalDrift& thermal) {
  section.vector("growth_um_per_m", thermal.expansion_per_m, kMicro);
  section.vector("shift_um", thermal.shift_m, kMicro);
  section.number("time_constant_s", thermal.time_constant_s, 1.0, kPositiveNumber);
  section.refuse_unknown_keys();
}

void read_path(TomlSection section, const std::string& file, SetupDraft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  std::string path;
  if (section.text("file", path)) draft.path_file = beside_file(file, path);
  section.number("feed_mm_per_min", simulation.path.feed_m_per_s, kMmPerMin, kPositiveNumber);
  section.number("acceleration_mm_per_s2", simulation.path.acceleration_m_per_s2, kMilli,
                 kPositiveNumber);
  section.number("dwell_s", simulation.path.dwell_s, 1.0, kNotNegativeNumber);
  section.duration("standstill_s", simulation.standstill);
  section.flag("start_when_streaming", simulation.start_when_streaming);
  section.refuse_unknown_keys();
}

void read_control(TomlSection section, SimulationSetup& simulation) {
  if (!section.present()) return;
  std::uint16_t port = 0;
  section.port("port", port);
  simulation.control_port = port;
  section.refuse_unknown_keys();
}

void read_probe(TomlSection section, SimulationSetup& simulation) {
  if (!section.present()) return;
  TouchedSurface surface;
  std::string name = "Z";
  section.text("axis", name);
  const auto axis = axis_named(name);

  if (!axis) section.fault("axis", "must be X, Y or Z");
  surface.axis = static_cast<int>(axis.value_or(Axis::Z));
  if (!section.number("surface_mm", surface.surface_m, kMilli))
    section.fault("surface_mm", "missing");
  section.number("delay_us", surface.delay_s, kMicro, kNotNegativeNumber);
  section.number("jitter_us", surface.jitter_s, kMicro, kNotNegativeNumber);
  section.refuse_unknown_keys();
  simulation.surface = surface;
}

}  // namespace

void read_sim(TomlSection sim, const std::string& file, SetupDraft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  std::string machine;

  if (sim.text("machine", machine)) draft.machine_file = beside_file(file, machine);
  sim.integer("seed", draft.seed, 0, INT64_MAX);
  sim.number("speed", draft.setup.speed, 1.0, {1e-3, 1e4});
  read_truth(sim.child("truth"), file, draft);
  read_thermal(sim.child("thermal"), simulation.truth.thermal);
  read_path(sim.child("path"), file, draft);
  read_control(sim.child("control"), simulation);
  read_sim_tracker(sim.child("tracker"), draft);
  TomlSection encoder = sim.child("encoder");
  encoder.port("port", simulation.bus->port);
  encoder.port("peer_port", simulation.bus->peer_port);
  encoder.text("interface", simulation.bus->interface);
  encoder.number("noise_nm", draft.encoder_noise, 1e-9, kNotNegativeNumber);
  double sync_period_us = 0.0;
  if (encoder.number("sync_period_us", sync_period_us, 1.0, {100.0, 1e6}))
    simulation.sync_period = seconds_to_ns(sync_period_us * 1e-6);
  encoder.refuse_unknown_keys();
  read_environment(sim, simulation.environment);
  read_sim_counter_card(sim.child("counter_card"), simulation);
  read_sim_evemu(sim.child("evemu"), draft.setup);
  read_ball_array(sim.child("ball_array"), draft.setup.array);
  read_probe(sim.child("probe"), simulation);
  std::string artefact;
  read_sim_cmm(sim.child("cmm"), simulation, artefact);
  if (!artefact.empty()) draft.artefact_file = beside_file(file, artefact);
  read_faults(sim, simulation.faults);
  sim.refuse_unknown_keys();
}

}  // namespace abbe::sim

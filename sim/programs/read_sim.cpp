#include "read_sim.hpp"

#include <chrono>
#include <cstdint>

#include "files.hpp"
#include "read_axis_lines.hpp"
#include "read_counter_card.hpp"
#include "read_environment.hpp"
#include "read_faults.hpp"
#include "read_measuring_machine.hpp"
#include "read_touching.hpp"
#include "read_tracker.hpp"

namespace abbe::sim {
namespace {

void read_truth(Section section, const std::string& file, SetupDraft& draft) {
  section.get("mean_error_um", draft.random.mean_error_m, kMicro, kPositiveNumber);
  section.get("node_spacing_mm", draft.random.node_spacing_m, kMilli, {0.1, 1e6});
  section.get("backlash_um", draft.random.backlash_m, kMicro, kNotNegativeNumber);
  section.get_word<Shape>("shape", draft.random.shape,
                          {{"linear", Shape::Linear}, {"cubic", Shape::Cubic}});
  std::string path;
  if (section.get("file", path)) draft.truth_file = beside_file(file, path);
  section.close(Hint::AllKeys);
}

void read_thermal(Section section, ThermalDrift& thermal) {
  get_vector(section, "growth_um_per_m", thermal.expansion_per_m, kMicro);
  get_vector(section, "shift_um", thermal.shift_m, kMicro);
  section.get("time_constant_s", thermal.time_constant_s, kPlain, kPositiveNumber);
  section.close(Hint::AllKeys);
}

void read_path(Section section, const std::string& file, SetupDraft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  std::string path;
  if (section.get("file", path)) draft.path_file = beside_file(file, path);
  section.get("feed_mm_per_min", simulation.path.feed_m_per_s, kPerMinute, kPositiveNumber);
  section.get("acceleration_mm_per_s2", simulation.path.acceleration_m_per_s2, kMilli,
              kPositiveNumber);
  section.get("dwell_s", simulation.path.dwell_s, kPlain, kNotNegativeNumber);
  section.get("standstill_s", simulation.standstill, kPlain, kNotNegativeNumber);
  section.get("start_when_streaming", simulation.start_when_streaming);
  section.close(Hint::AllKeys);
}

void read_control(Section section, SimulationSetup& simulation) {
  if (!section.present()) return;
  std::uint16_t port = 0;
  get_port(section, "port", port);
  simulation.control_port = port;
  section.close(Hint::AllKeys);
}

void read_probe(Section section, SimulationSetup& simulation) {
  if (!section.present()) return;
  TouchedSurface surface;
  std::string name = "Z";
  section.get("axis", name);
  const auto axis = axis_named(name);

  if (!axis) section.fault("axis", "must be X, Y or Z");
  surface.axis = static_cast<int>(axis.value_or(Axis::Z));
  section.get("surface_mm", surface.surface_m, kMilli, kAnyNumber, Need::Required);
  section.get("delay_us", surface.delay_s, kMicro, kNotNegativeNumber);
  section.get("jitter_us", surface.jitter_s, kMicro, kNotNegativeNumber);
  section.close(Hint::AllKeys);
  simulation.surface = surface;
}

}  // namespace

void read_sim(Section sim, const std::string& file, SetupDraft& draft) {
  SimulationSetup& simulation = draft.setup.simulation;
  std::string machine;

  if (sim.get("machine", machine)) draft.machine_file = beside_file(file, machine);
  sim.get_integer("seed", draft.seed, 0, INT64_MAX);
  sim.get("speed", draft.setup.speed, kPlain, {1e-3, 1e4});
  read_truth(sim.child("truth"), file, draft);
  read_thermal(sim.child("thermal"), simulation.truth.thermal);
  read_path(sim.child("path"), file, draft);
  read_control(sim.child("control"), simulation);
  read_sim_tracker(sim.child("tracker"), draft);
  Section encoder = sim.child("encoder");
  get_port(encoder, "port", simulation.bus->port);
  get_port(encoder, "peer_port", simulation.bus->peer_port);
  encoder.get_maybe_empty("interface", simulation.bus->interface);
  encoder.get("noise_nm", draft.encoder_noise, kNano, kNotNegativeNumber);
  double sync_period_us = 0.0;
  if (encoder.get("sync_period_us", sync_period_us, kPlain, {100.0, 1e6}))
    simulation.sync_period = seconds_to_ns(sync_period_us * 1e-6);
  encoder.close(Hint::AllKeys);
  read_sim_axis_lines(sim.child("axis_lines"), simulation);
  read_environment(sim, simulation.environment);
  read_sim_counter_card(sim.child("counter_card"), simulation);
  read_sim_evemu(sim.child("evemu"), draft.setup);
  read_ball_array(sim.child("ball_array"), draft.setup.array);
  read_probe(sim.child("probe"), simulation);
  std::string artefact;
  read_sim_cmm(sim.child("cmm"), simulation, artefact);
  if (!artefact.empty()) draft.artefact_file = beside_file(file, artefact);
  read_faults(sim, simulation.faults);
  sim.close(Hint::AllKeys);
}

}  // namespace abbe::sim

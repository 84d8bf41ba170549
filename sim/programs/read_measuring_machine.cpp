#include "read_measuring_machine.hpp"

namespace abbe::sim {
namespace {

void read_place(TomlSection& section, Eigen::Vector3d& place_m) {
  section.number("x_mm", place_m.x(), kMilli);
  section.number("y_mm", place_m.y(), kMilli);
  section.number("z_mm", place_m.z(), kMilli);
}

void read_features(TomlSection root, MeasuringMachine& machine) {
  root.child("calibrator").number("tip_radius_mm", machine.tip_radius_m, kMilli, kPositiveNumber);
  for (TomlSection& section : root.children("ball")) {
    Sphere ball;
    read_place(section, ball.centre_m);
    section.number("radius_mm", ball.radius_m, kMilli, kPositiveNumber);
    machine.spheres.push_back(ball);
  }

  for (TomlSection& section : root.children("block")) {
    Face face;
    read_place(section, face.centre_m);
    section.vector("normal", face.normal);
    section.number("half_size_mm", face.half_size_m, kMilli, kPositiveNumber);
    if (!(face.normal.norm() > 0.0)) section.fault("normal", "must not be the zero vector");
    machine.faces.push_back(face);
  }
}

}  // namespace

void read_cmm(TomlSection section, SimulationSetup& simulation) {
  if (!section.present()) return;
  IppDmeOptions machine;
  // A measuring machine has a volume of its own: travels and errors of the machine tool do not
  // apply.
  machine.machine.truth = {};
  std::string tool;
  if (section.text("tool", tool)) machine.tools.push_back(tool);
  section.port("port", simulation.measuring_machine_port);
  simulation.measuring_machine = machine;
}

void read_sim_cmm(TomlSection section, SimulationSetup& simulation, std::string& artefact_file) {
  if (!section.present()) return;
  if (!simulation.measuring_machine)
    return section.fault("", "there is no [cmm] in the machine file");
  IppDmeOptions& machine = *simulation.measuring_machine;
  section.port("port", simulation.measuring_machine_port);
  section.text("artefact", artefact_file);
  section.number("noise_um", machine.machine.noise_m, kMicro, kNotNegativeNumber);
  section.number("travel_mm_per_s", machine.travel_speed_m_s, kMilli, kPositiveNumber);
  section.number("probing_mm_per_s", machine.probing_speed_m_s, kMilli, kPositiveNumber);
  section.flag("homed", machine.homed);
  section.refuse_unknown_keys();
}

Result<void> read_artefact(const std::string& file, MeasuringMachine& machine) {
  return read_toml_file(file, [&](TomlSection root) { read_features(std::move(root), machine); });
}

}  // namespace abbe::sim

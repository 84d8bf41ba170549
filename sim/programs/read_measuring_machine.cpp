#include "read_measuring_machine.hpp"

namespace abbe::sim {
namespace {

void read_place(Section& section, Eigen::Vector3d& place_m) {
  section.get("x_mm", place_m.x(), kMilli, kAnyNumber);
  section.get("y_mm", place_m.y(), kMilli, kAnyNumber);
  section.get("z_mm", place_m.z(), kMilli, kAnyNumber);
}

void read_features(Section root, MeasuringMachine& machine) {
  root.child("calibrator").get("tip_radius_mm", machine.tip_radius_m, kMilli, kPositiveNumber);
  for (Section& section : root.children("ball")) {
    Sphere ball;
    read_place(section, ball.centre_m);
    section.get("radius_mm", ball.radius_m, kMilli, kPositiveNumber);
    machine.spheres.push_back(ball);
  }

  for (Section& section : root.children("block")) {
    Face face;
    read_place(section, face.centre_m);
    get_vector(section, "normal", face.normal, kPlain);
    section.get("half_size_mm", face.half_size_m, kMilli, kPositiveNumber);
    if (!(face.normal.norm() > 0.0)) section.fault("normal", "must not be the zero vector");
    machine.faces.push_back(face);
  }
}

}  // namespace

void read_cmm(Section section, SimulationSetup& simulation) {
  if (!section.present()) return;
  IppDmeOptions machine;
  // A measuring machine has its own volume; travels and errors of the machine tool do not apply.
  machine.machine.truth = {};
  std::string tool;
  if (section.get("tool", tool)) machine.tools.push_back(tool);
  get_port(section, "port", simulation.measuring_machine_port);
  simulation.measuring_machine = machine;
}

void read_sim_cmm(Section section, SimulationSetup& simulation, std::string& artefact_file) {
  if (!section.present()) return;
  if (!simulation.measuring_machine)
    return section.fault("", "there is no [cmm] in the machine file");
  IppDmeOptions& machine = *simulation.measuring_machine;
  get_port(section, "port", simulation.measuring_machine_port);
  section.get("artefact", artefact_file);
  section.get("noise_um", machine.machine.noise_m, kMicro, kNotNegativeNumber);
  section.get("travel_mm_per_s", machine.travel_speed_m_s, kMilli, kPositiveNumber);
  section.get("probing_mm_per_s", machine.probing_speed_m_s, kMilli, kPositiveNumber);
  section.get("homed", machine.homed);
  section.close(Hint::AllKeys);
}

Result<void> read_artefact(const std::string& file, MeasuringMachine& machine) {
  return read_toml_file(file, [&](Section root) { read_features(std::move(root), machine); });
}

}  // namespace abbe::sim

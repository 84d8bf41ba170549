#include "read_tracker.hpp"

#include <string>
#include <vector>

namespace abbe::sim {
namespace {

void read_device(TomlSection& section, SimulationSetup& simulation) {
  TrackerOptions& tracker = *simulation.tracker;
  TrackerModel& model = tracker.model;
  section.port("port", simulation.tracker_port);
  section.vector("position_mm", model.position_m, kMilli);
  section.vector("rotation_rad", model.rotation_rad);
  section.number("sigma_range_um", model.sigma_range_m, kMicro, kNotNegativeNumber);
  section.number("sigma_angle_urad", model.sigma_angle_rad, kMicro, kNotNegativeNumber);
  section.number("max_radial_speed_mm_per_s", model.max_radial_speed_m_per_s, kMilli,
                 kPositiveNumber);
  section.number("max_lateral_speed_mm_per_s", model.max_lateral_speed_m_per_s, kMilli,
                 kPositiveNumber);
  section.number("clock_offset_s", model.clock_offset_s, 1.0, {0.0, 2e9});
  section.number("clock_drift_ppm", model.clock_drift_ppm, 1.0, {-1000.0, 1000.0});
  section.duration("delay_ms", tracker.delay, kMilli);
  section.duration("warm_up_s", tracker.warm_up);
  section.duration("command_latency_ms", tracker.command_latency, kMilli);
  section.duration("initialize_s", tracker.initialize_time);
  section.duration("fetch_beam_s", tracker.fetch_beam);
  section.number("air_temperature_C", tracker.air_temperature_C);
  section.number("air_pressure_mbar", tracker.air_pressure_mbar);
  section.number("air_humidity_percent", tracker.air_humidity_percent);
  section.number("air_drift_K_per_hour", tracker.air_drift_K_per_hour);
}

void read_drift(TomlSection& section, SetupDraft& draft) {
  std::string course = "linear";
  section.vector("drift_um", draft.drift_at_end_m, kMicro);
  section.text("drift_course", course);
  if (course != "linear" && course != "random-walk")
    section.fault("drift_course", "must be \"linear\" or \"random-walk\"");
  draft.drift_is_random_walk = course == "random-walk";
}

ReferenceNest read_nest(TomlSection& section) {
  ReferenceNest nest;
  if (!section.vector("position_mm", nest.position_m, kMilli))
    section.fault("position_mm", "missing");
  section.vector("moved_um", nest.moved_m, kMicro);
  section.number("moved_at_s", nest.moved_at_s, 1.0, kNotNegativeNumber);
  section.refuse_unknown_keys();
  return nest;
}

void read_visits(TomlSection& section, SetupDraft& draft) {
  NestVisits& visits = draft.setup.simulation.tracker->model.nests;
  section.flag("nest_visits", draft.nest_visits);
  section.number("nest_every_s", draft.setup.simulation.path.wait_every_s, 1.0, kNotNegativeNumber);
  section.number("nest_stay_s", visits.stay_s, 1.0, kPositiveNumber);
  section.number("nest_move_s", visits.move_s, 1.0, kNotNegativeNumber);
  section.number("nest_repeatability_um", visits.repeatability_m, kMicro, kNotNegativeNumber);

  std::vector<ReferenceNest> nests;
  for (TomlSection& nest : section.children("nest")) nests.push_back(read_nest(nest));
  if (!nests.empty()) visits.nests = nests;
}

}  // namespace

void read_sim_tracker(TomlSection section, SetupDraft& draft) {
  read_device(section, draft.setup.simulation);
  read_drift(section, draft);
  read_visits(section, draft);
  section.refuse_unknown_keys();
}

void read_nests(TomlSection& tracker, SimulationSetup& simulation) {
  NestVisits& visits = simulation.tracker->model.nests;
  tracker.number("nest_repeatability_um", visits.repeatability_m, kMicro, kNotNegativeNumber);
  for (TomlSection& section : tracker.children("nest")) {
    ReferenceNest nest;
    if (section.vector("position_mm", nest.position_m, kMilli)) visits.nests.push_back(nest);
  }
}

}  // namespace abbe::sim

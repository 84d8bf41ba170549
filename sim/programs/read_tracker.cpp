#include "read_tracker.hpp"

#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

#include "read_lines.hpp"

namespace abbe::sim {
namespace {

void read_device(Section& section, SimulationSetup& simulation) {
  TrackerOptions& tracker = *simulation.tracker;
  TrackerModel& model = tracker.model;
  get_port(section, "port", simulation.tracker_port);
  get_vector(section, "position_mm", model.position_m, kMilli);
  get_vector(section, "rotation_rad", model.rotation_rad, kPlain);
  section.get("sigma_range_um", model.sigma_range_m, kMicro, kNotNegativeNumber);
  section.get("sigma_angle_urad", model.sigma_angle_rad, kMicro, kNotNegativeNumber);
  section.get("max_radial_speed_mm_per_s", model.max_radial_speed_m_per_s, kMilli, kPositiveNumber);
  section.get("max_lateral_speed_mm_per_s", model.max_lateral_speed_m_per_s, kMilli,
              kPositiveNumber);
  section.get("clock_offset_s", model.clock_offset_s, kPlain, {0.0, 2e9});
  section.get("clock_drift_ppm", model.clock_drift_ppm, kPlain, {-1000.0, 1000.0});
  section.get("delay_ms", tracker.delay, kMilli, kNotNegativeNumber);
  section.get("warm_up_s", tracker.warm_up, kPlain, kNotNegativeNumber);
  section.get("command_latency_ms", tracker.command_latency, kMilli, kNotNegativeNumber);
  section.get("initialize_s", tracker.initialize_time, kPlain, kNotNegativeNumber);
  section.get("fetch_beam_s", tracker.fetch_beam, kPlain, kNotNegativeNumber);
  section.get("air_temperature_C", tracker.air_temperature_C, kPlain, kAnyNumber);
  section.get("air_pressure_mbar", tracker.air_pressure_mbar, kPlain, kAnyNumber);
  section.get("air_humidity_percent", tracker.air_humidity_percent, kPlain, kAnyNumber);
  section.get("air_drift_K_per_hour", tracker.air_drift_K_per_hour, kPlain, kAnyNumber);
}

void read_drift(Section& section, SetupDraft& draft) {
  get_vector(section, "drift_um", draft.drift_at_end_m, kMicro);
  section.get_word<bool>("drift_course", draft.drift_is_random_walk,
                         {{"linear", false}, {"random-walk", true}});
}

ReferenceNest read_nest(Section& section) {
  ReferenceNest nest;
  get_vector(section, "position_mm", nest.position_m, kMilli, Need::Required);
  get_vector(section, "moved_um", nest.moved_m, kMicro);
  section.get("moved_at_s", nest.moved_at_s, kPlain, kNotNegativeNumber);
  section.close(Hint::AllKeys);
  return nest;
}

void read_visits(Section& section, SetupDraft& draft) {
  NestVisits& visits = draft.setup.simulation.tracker->model.nests;
  section.get("nest_visits", draft.nest_visits);
  section.get("nest_every_s", draft.setup.simulation.path.wait_every_s, kPlain, kNotNegativeNumber);
  section.get("nest_stay_s", visits.stay_s, kPlain, kPositiveNumber);
  section.get("nest_move_s", visits.move_s, kPlain, kNotNegativeNumber);
  section.get("nest_repeatability_um", visits.repeatability_m, kMicro, kNotNegativeNumber);

  std::vector<ReferenceNest> nests;
  for (Section& nest : section.children("nest")) nests.push_back(read_nest(nest));
  if (!nests.empty()) visits.nests = nests;
}

using lines::Column;

void read_columns(Section& section, lines::LineFormat& format) {
  std::vector<std::string> names;
  if (!section.get("columns", names)) return;
  if (names.size() > lines::LineFormat::kMostColumns)
    return section.fault("columns", "are too many");
  format.column_count = 0;
  for (const std::string& name : names) {
    Column column = Column::Ignored;
    while (column != Column::Status && lines::name_of(column) != name)
      column = static_cast<Column>(static_cast<int>(column) + 1);
    if (lines::name_of(column) != name)
      return section.fault("columns", fmt::format("\"{}\" is no column", name));
    format.columns[format.column_count++] = column;
  }
}

}  // namespace

void read_lines(Section& tracker, SimulationSetup& simulation) {
  bool as_lines = simulation.tracker_lines.has_value();
  tracker.get_word<bool>("protocol", as_lines, {{"emscon", false}, {"lines", true}});
  if (!as_lines) return simulation.tracker_lines.reset();
  if (!simulation.tracker_lines) simulation.tracker_lines.emplace();
  auto& line = *simulation.tracker_lines;
  read_line_output(tracker, line.output);
  read_line_rate(tracker, "point_rate_hz", line.separation);
  read_columns(tracker, line.format);
  read_line_units(tracker, line.format.metres_per_length, line.format.radians_per_angle);
  read_line_syntax(tracker, line.format);
  if (line.format.column_count == 0)
    return tracker.fault("columns", "missing: the columns of a line, in their order");
  if (const auto what = lines::format_fault(line.format); !what.empty())
    tracker.fault("columns", what);
}

void read_sim_tracker(Section section, SetupDraft& draft) {
  read_device(section, draft.setup.simulation);
  read_lines(section, draft.setup.simulation);
  read_drift(section, draft);
  read_visits(section, draft);
  section.close(Hint::AllKeys);
}

void read_nests(Section& tracker, SimulationSetup& simulation) {
  NestVisits& visits = simulation.tracker->model.nests;
  tracker.get("nest_repeatability_um", visits.repeatability_m, kMicro, kNotNegativeNumber);
  for (Section& section : tracker.children("nest")) {
    ReferenceNest nest;
    if (get_vector(section, "position_mm", nest.position_m, kMilli)) visits.nests.push_back(nest);
  }
}

}  // namespace abbe::sim

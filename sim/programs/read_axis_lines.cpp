#include "read_axis_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "read_lines.hpp"
#include "read_machine.hpp"

namespace abbe::sim {
namespace {

using lines::ColumnUse;

/// Largest reading that the format of abbe-sim needs, m or rad.
constexpr double kAnyReading = 1e6;

/// X, Y, Z or a rotary axis of [axes].
std::optional<MeasuredAxis> printed_axis(Section root, const std::string& name) {
  if (const auto linear = axis_named(name)) return MeasuredAxis{*linear};
  if (is_rotary(root, name)) return MeasuredAxis{RotarySwing{}};
  return std::nullopt;
}

void add_axis_column(Section root, Section& section, const std::string& name,
                     const std::pair<double, double>& units, LineAxesOptions& out) {
  lines::ValueFormat& format = out.format;
  lines::ValueColumn& column = format.columns[format.column_count];
  format.names[format.column_count++] = name;
  if (name == "-") return;
  if (name == "time" || name == "status") {
    column.use = name == "time" ? ColumnUse::Time : ColumnUse::Status;
    return;
  }

  const auto axis = printed_axis(std::move(root), name);
  if (!axis || format.value_count == lines::ValueFormat::kMostValues)
    return section.fault("columns", fmt::format("\"{}\" is no axis", name));
  column.use = ColumnUse::Value;
  column.value = static_cast<std::uint8_t>(format.value_count++);
  column.scale = std::holds_alternative<Axis>(*axis) ? units.first : units.second;
  column.limit = kAnyReading;
  out.axes.push_back(*axis);
}

/// reading = offset + number, or offset - number where the axis is inverted.
void read_axis_offset(Section& section, lines::ValueFormat& format) {
  std::string name;
  section.get("axis", name);
  const auto* const place = std::ranges::find(format.names, name);
  if (place == format.names.end()) return section.fault("axis", "has no column");
  lines::ValueColumn& column =
      format.columns[static_cast<std::size_t>(place - format.names.begin())];
  section.get("offset_mm", column.offset, kMilli, kAnyNumber);
  section.get("offset_rad", column.offset, kPlain, kAnyNumber);
  bool invert = false;
  section.get("invert", invert);
  if (invert) column.scale = -column.scale;
}

}  // namespace

void read_axis_lines(Section root, SimulationSetup& simulation) {
  Section section = root.child("axis_lines");
  if (!section.present()) return;
  PrintedAxes printed;
  LineAxesOptions& options = printed.options;
  read_line_output(section, printed.output);
  get_port(section, "port", printed.output.port);
  read_line_rate(section, "sample_rate_hz", options.times.separation);
  read_line_syntax(section, options.format);
  std::pair<double, double> units{1e-3, 1.0};
  read_line_units(section, units.first, units.second);

  std::vector<std::string> names;
  section.get("columns", names);
  if (names.size() > lines::ValueFormat::kMostColumns)
    return section.fault("columns", "are too many");
  for (const std::string& name : names) add_axis_column(root, section, name, units, options);
  for (Section& axis : section.children("axes")) read_axis_offset(axis, options.format);
  if (const auto what = lines::format_fault(options.format); !what.empty())
    section.fault("columns", what);
  simulation.axis_lines = std::move(printed);
}

void read_sim_axis_lines(Section section, SimulationSetup& simulation) {
  if (!section.present()) return;
  if (!simulation.axis_lines)
    return section.fault("", "there is no [axis_lines] in the machine file");
  LineAxesOptions& options = simulation.axis_lines->options;
  get_port(section, "port", simulation.axis_lines->output.port);
  section.get("serial", simulation.axis_lines->output.link);
  section.get("noise_nm", options.noise, kNano, kNotNegativeNumber);
  section.get("clock_offset_s", options.times.clock.offset_s, kPlain, {0.0, 2e9});
  section.get("clock_drift_ppm", options.times.clock.drift_ppm, kPlain, {-1000.0, 1000.0});
  section.get("delay_ms", options.times.delay, kMilli, kNotNegativeNumber);
  section.get("bursts", options.times.bursts);
  section.close(Hint::AllKeys);
}

}  // namespace abbe::sim

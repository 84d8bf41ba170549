#include "abbe/config/kinds/axis_lines.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "abbe/protocol/lines/tracker_line.hpp"
#include "classified_section.hpp"
#include "config_kind.hpp"
#include "machine_order.hpp"
#include "message_bounds.hpp"
#include "plausible.hpp"
#include "read_lines.hpp"

namespace abbe::daemon {
namespace {

using protocol::lines::ColumnUse;
using protocol::lines::ValueFormat;

/// A rotary axis that counts more turns does not exist: the unit is a wrong one.
constexpr double kLargestRotation_rad = 2000.0 * std::numbers::pi;

/// Unit of the positions, in m and rad.
struct PositionUnits {
  double length = 1e-3;
  double angle = 1.0;
};

/// Adds the column `index` to the axes unless it is the time, the status or ignored.
void add_axis_column(ClassifiedSection& table, const MachineConfig& machine, std::size_t index,
                     AxisLinesConfig& out) {
  const std::string& name = out.format.names[index];
  if (name == "-") return;
  if (name == "time" || name == "status") {
    out.format.columns[index].use = name == "time" ? ColumnUse::Time : ColumnUse::Status;
    return;
  }

  const AxisConfig* const axis = machine.find_axis(name);
  if (axis == nullptr && !machine.axes.empty())
    return table.fault("columns", fmt::format("\"{}\" must be an axis in [axes], \"time\", "
                                              "\"status\" or \"-\" (ignored)",
                                              name));
  if (std::ranges::find(out.axes, name, &AxisColumnConfig::axis) != out.axes.end())
    return table.fault("columns", fmt::format("axis {} has two columns", name));
  const bool linear = axis == nullptr || axis->kind == AxisKind::Linear;
  out.axes.push_back({.axis = name, .column = index, .linear = linear});
}

void read_axis_columns(ClassifiedSection& table, const MachineConfig& machine,
                       AxisLinesConfig& out) {
  std::vector<std::string> names;
  table.get(reading("columns"), names);
  if (names.empty())
    return table.fault("columns",
                       "missing: the columns of a line in their order, axes in [axes], "
                       "\"time\", \"status\" or \"-\" (ignored)");
  if (names.size() > ValueFormat::kMostColumns)
    return table.fault("columns", fmt::format("must be at most {}", ValueFormat::kMostColumns));
  out.format.column_count = names.size();
  std::ranges::move(names, out.format.names.begin());
  for (std::size_t i = 0; i < out.format.column_count; ++i) add_axis_column(table, machine, i, out);
  put_in_order_of_the_machine(machine, &AxisColumnConfig::axis, table, "columns", "column",
                              out.axes);
}

bool has_axis(const AxisLinesConfig& out, bool linear) {
  return std::ranges::find(out.axes, linear, &AxisColumnConfig::linear) != out.axes.end();
}

void read_position_units(ClassifiedSection& table, AxisLinesConfig& out) {
  PositionUnits units;
  const auto need = [&](bool linear) {
    return has_axis(out, linear) ? Need::Required : Need::Optional;
  };
  table.get_word<double>(reading("length_unit"), units.length, line_length_units(), need(true));
  table.get_word<double>(if_given(reading("angle_unit")), units.angle, line_angle_units(),
                         need(false));
  if (table.has("angle_unit") && !has_axis(out, false))
    table.fault("angle_unit", "has no meaning: no column is a rotary axis");
  for (AxisColumnConfig& axis : out.axes) axis.unit = axis.linear ? units.length : units.angle;
}

/// `axes`: what of an axis differs from its column.
void read_axis_signs(ClassifiedSection& table, AxisLinesConfig& out) {
  for (auto& section : table.children("axes", "axis")) {
    std::string name;
    section.get(stated("axis"), name, Need::Required);
    const auto axis = std::ranges::find(out.axes, name, &AxisColumnConfig::axis);
    AxisColumnConfig none;
    AxisColumnConfig& read = axis == out.axes.end() ? none : *axis;
    if (!name.empty() && axis == out.axes.end()) section.fault("axis", "has no column");
    section.get(reading(read.linear ? "offset_mm" : "offset_rad"), read.offset,
                read.linear ? kMilli : kPlain, kAny);
    bool invert = false;
    if (section.get(reading("invert"), invert) && invert) read.unit = -read.unit;
    section.close();
  }
}

void make_format(ClassifiedSection& table, AxisLinesConfig& out) {
  ValueFormat& format = out.format;
  format.value_count = std::min(out.axes.size(), protocol::kMaxAxes);
  if (out.axes.size() > protocol::kMaxAxes)
    table.fault("columns", fmt::format("must be at most {} axes", protocol::kMaxAxes));

  for (std::size_t i = 0; i < format.value_count; ++i) {
    const AxisColumnConfig& axis = out.axes[i];
    format.columns[axis.column] = {
        .use = ColumnUse::Value,
        .value = static_cast<std::uint8_t>(i),
        .scale = axis.unit,
        .offset = axis.offset,
        .limit = axis.linear ? protocol::lines::kLargestCoordinate_m : kLargestRotation_rad};
  }

  if (format.value_count == 0) return;  // reported already
  if (const auto what = protocol::lines::format_fault(format); !what.empty())
    table.fault("columns", what);
}

/// The time of a line is in it, or it is known by its arrival as well as `latency_ms` states.
void read_time_of_lines(ClassifiedSection& table, AxisLinesConfig& out) {
  constexpr Bounds kLatency_ms{0.01, 10e3};
  table.get(operation("sample_rate_hz"), out.sample_rate_hz, kPlain, {0.1, 10e3}, Need::Required);
  const bool has_time = out.format.has(ColumnUse::Time);
  const auto unused = has_time ? "latency_ms" : "max_constant_delay_us";
  if (has_time) {
    table.get(reading("max_constant_delay_us"), out.max_constant_delay, kMicro, kNotNegative);
    if (out.max_constant_delay > std::chrono::milliseconds{100})
      table.implausible("max_constant_delay_us", "is more than 100 ms");
  } else if (out.format.column_count > 0) {
    std::chrono::nanoseconds latency{};
    if (!table.get(if_given(reading("latency_ms")), latency, kMilli, kLatency_ms))
      table.fault(
          "latency_ms",
          "missing: no column is \"time\", so the time of a position is that of its arrival "
          "minus half the largest delay; state the largest delay from the measurement of "
          "a position to the arrival of its line");
    out.latency = latency;
    if (table.has("time_unit")) table.fault("time_unit", "has no meaning: no column has this unit");
  }
  if (table.has(unused))
    table.fault(unused, has_time ? "has no meaning: a column is \"time\""
                                 : "has no meaning: no column is \"time\"; see latency_ms");
}

void read_axis_lines(ClassifiedSection& root, Config& out, StreamNames& names) {
  ClassifiedSection table = root.child("axis_lines");
  if (!table.present()) return;
  AxisLinesConfig config;
  get_bounded(table, operation("name"), config.name, bound_of<v1::AxisSample>("device"));
  config.address = read_line_address(table);
  read_axis_columns(table, out.machine, config);
  read_position_units(table, config);
  read_axis_signs(table, config);
  read_line_syntax(table, Role::Reading, config.format.has(ColumnUse::Status), config.format);
  make_format(table, config);
  read_time_of_lines(table, config);
  table.get(reading("axes_compensated"), config.axes_compensated);
  table.get(operation("connect_timeout_s"), config.connect_timeout, kPlain, kPositive);
  table.get(operation("silence_timeout_s"), config.silence_timeout, kPlain, kPositive);

  for (const AxisColumnConfig& axis : config.axes)
    refuse_claimed_axis(table, "columns", axis.axis, AxisLinesConfig::kKind.key, out);
  table.close();
  names.take(config.name, table);
  out.of<AxisLinesConfig>() = std::move(config);
}

std::vector<std::string> axis_lines_summary(const Config& config) {
  const auto& axes = config.of<AxisLinesConfig>();
  if (!axes) return {};
  const auto names = std::span{axes->format.names}.first(axes->format.column_count);
  const auto time =
      axes->latency ? fmt::format(", time by arrival within {:g} ms",
                                  std::chrono::duration<double, std::milli>(*axes->latency).count())
                    : std::string{};
  return {fmt::format("lines ({}) from {}, {:g} per second{}", fmt::join(names, " "),
                      drivers::text_of(axes->address), axes->sample_rate_hz, time)};
}

std::optional<AxisReadings> axes_of_lines(const Config& config) {
  const auto& lines = config.of<AxisLinesConfig>();
  if (!lines) return std::nullopt;
  AxisReadings readings{
      .key = AxisLinesConfig::kKind.key, .axes = {}, .compensated = lines->axes_compensated};
  for (const AxisColumnConfig& axis : lines->axes) readings.axes.push_back(axis.axis);
  return readings;
}

/// By arrival, two samples are further apart by as much as their delays differ.
std::optional<std::chrono::nanoseconds> time_of_axis_lines(const Config& config, double periods) {
  const auto& lines = config.of<AxisLinesConfig>();
  if (!lines) return std::nullopt;
  const std::chrono::duration<double> time{periods / lines->sample_rate_hz};
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time) +
         lines->latency.value_or(std::chrono::nanoseconds{0});
}

}  // namespace

const ConfigKind AxisLinesConfig::kKind{.key = "axis_lines",
                                        .read = &read_axis_lines,
                                        .summary = &axis_lines_summary,
                                        .axes = &axes_of_lines,
                                        .time_of_axis_samples = &time_of_axis_lines};

}  // namespace abbe::daemon

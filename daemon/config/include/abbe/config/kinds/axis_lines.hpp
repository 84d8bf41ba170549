#pragma once
/// [axis_lines]: a control or a program that prints the positions of the axes as lines of text.
/// Pure data.

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "abbe/drivers/lines/link.hpp"
#include "abbe/protocol/lines/value_line.hpp"

namespace abbe::daemon {

struct ConfigKind;

/// A column with the position of an axis, with
///
///   reading = offset + number * unit
///
/// `invert = true` in the file makes the unit negative.
struct AxisColumnConfig {
  std::string axis;
  std::size_t column = 0;  ///< from 0
  double unit = 1e-3;      ///< m or rad, signed
  double offset = 0.0;     ///< m or rad
  bool linear = true;
};

struct AxisLinesConfig {
  static const ConfigKind kKind;
  std::string name = "axis_lines";
  drivers::LineAddress address;
  /// Value i is the axis i of `axes`.
  protocol::lines::ValueFormat format;
  /// In the order of MachineConfig::axes; contains X, Y and Z.
  std::vector<AxisColumnConfig> axes;
  double sample_rate_hz = 0.0;
  /// Without a time column: upper bound of the delay between a measurement and the arrival of its
  /// line. nullopt: there is a time column.
  std::optional<std::chrono::nanoseconds> latency;
  /// With a time column: upper bound of the constant delay of a line after its measurement.
  std::chrono::nanoseconds max_constant_delay{std::chrono::milliseconds{2}};
  /// True: the control already corrects these readings.
  bool axes_compensated = false;
  std::chrono::nanoseconds connect_timeout{std::chrono::seconds{3}};
  std::chrono::nanoseconds silence_timeout{std::chrono::milliseconds{1500}};
};

}  // namespace abbe::daemon

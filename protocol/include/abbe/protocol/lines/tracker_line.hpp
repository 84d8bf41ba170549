#pragma once
/// One tracker point as a line of text with columns in a configured order, as measuring programs
/// and scripts print them:
///
///   1764571234.5020 1523.1042 -310.5518 88.1207 0
///
/// The decoder returns SI units. A line that does not fit the format is refused with the column at
/// fault: a guess could shift every column by one. Pure, real time, thread-safe.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <tl/expected.hpp>

#include "abbe/protocol/lines/line_format.hpp"
#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::lines {

/// What a column holds. Range, azimuth and elevation (or zenith) are spherical coordinates:
/// x = r cos(el) cos(az), y = r cos(el) sin(az), z = r sin(el), zenith = 90 degrees - elevation.
enum class Column : std::uint8_t {
  Ignored,
  X,
  Y,
  Z,
  Range,
  Azimuth,
  Elevation,
  Zenith,
  Time,    ///< instant of the measurement on the clock of the sender
  Status,  ///< a word or a number
};

struct LineFormat : LineSyntax {
  std::array<Column, kMostColumns> columns{};
  double metres_per_length = 1e-3;
  double radians_per_angle = 1.0;

  [[nodiscard]] bool has(Column column) const ABBE_RT;
};

/// What is wrong with a format: columns that are missing, double, or exclude each other. Empty: the
/// format is valid.
[[nodiscard]] std::string_view format_fault(const LineFormat& format) ABBE_RT;

/// Coordinates, m. A line with a larger one is refused: its unit is not the configured one.
inline constexpr double kLargestCoordinate_m = 1000.0;

struct TrackerLine : LineMarks {
  std::array<double, 3> p_tracker_m{};
};

[[nodiscard]] tl::expected<TrackerLine, LineFault> decode(std::string_view line,
                                                          const LineFormat& format) ABBE_RT;

/// "x", "azimuth", ...: as in the configuration.
[[nodiscard]] std::string_view name_of(Column column) ABBE_RT;
/// Of column `index`, from 0.
[[nodiscard]] std::string_view column_name(const LineFormat& format, std::size_t index) ABBE_RT;

}  // namespace abbe::protocol::lines

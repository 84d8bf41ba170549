#include "abbe/protocol/lines/tracker_line.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "abbe/protocol/lines/fields.hpp"
#include "decode_columns.hpp"

namespace abbe::protocol::lines {
namespace {

using What = LineFault::What;

constexpr std::size_t kColumnKinds = static_cast<std::size_t>(Column::Status) + 1;
constexpr double kRightAngle_rad = std::numbers::pi / 2.0;
/// Some instruments count several turns; more than two are a wrong unit.
constexpr double kLargestAzimuth_rad = 4.0 * std::numbers::pi;
/// An elevation is at most a right angle. Encoders of a head that passed the zenith show a little
/// more.
constexpr double kLargestElevation_rad = kRightAngle_rad + 1e-3;

/// Largest magnitude of a coordinate in SI units.
double limit_of(Column column) noexcept {
  switch (column) {
    case Column::Azimuth:
      return kLargestAzimuth_rad;
    case Column::Elevation:
      return kLargestElevation_rad;
    case Column::Zenith:
      return kRightAngle_rad + kLargestElevation_rad;
    default:
      return kLargestCoordinate_m;
  }
}

ColumnUse use_of(Column column) noexcept {
  switch (column) {
    case Column::Ignored:
      return ColumnUse::Ignored;
    case Column::Time:
      return ColumnUse::Time;
    case Column::Status:
      return ColumnUse::Status;
    default:
      return ColumnUse::Value;
  }
}

bool is_angle(Column column) noexcept {
  return column == Column::Azimuth || column == Column::Elevation || column == Column::Zenith;
}

/// Coordinates in SI units, by column.
using Values = std::array<double, kColumnKinds>;

double& value_of(Values& values, Column column) noexcept {
  return values[static_cast<std::size_t>(column)];
}

std::optional<What> read_coordinate(std::string_view field, Column column, const LineFormat& format,
                                    Values& values) noexcept {
  const auto read = number(field, format.decimal_sign);
  if (!read) return What::NotANumber;
  const double si =
      *read * (is_angle(column) ? format.radians_per_angle : format.metres_per_length);
  if (!(std::abs(si) <= limit_of(column))) return What::OutOfRange;
  if ((column == Column::Range || column == Column::Zenith) && si < 0.0) return What::OutOfRange;
  value_of(values, column) = si;
  return std::nullopt;
}

std::array<double, 3> position(Values& values, const LineFormat& format) noexcept {
  if (!format.has(Column::Range))
    return {value_of(values, Column::X), value_of(values, Column::Y), value_of(values, Column::Z)};
  const double range = value_of(values, Column::Range);
  const double azimuth = value_of(values, Column::Azimuth);
  const double elevation = format.has(Column::Zenith)
                               ? kRightAngle_rad - value_of(values, Column::Zenith)
                               : value_of(values, Column::Elevation);
  return {range * std::cos(elevation) * std::cos(azimuth),
          range * std::cos(elevation) * std::sin(azimuth), range * std::sin(elevation)};
}

}  // namespace

bool LineFormat::has(Column column) const ABBE_RT {
  const auto end = columns.begin() + static_cast<std::ptrdiff_t>(column_count);
  return std::find(columns.begin(), end, column) != end;
}

std::string_view format_fault(const LineFormat& format) ABBE_RT {
  if (format.column_count > LineFormat::kMostColumns) return "has too many columns";
  std::array<int, kColumnKinds> count{};
  for (std::size_t i = 0; i < format.column_count; ++i)
    ++count[static_cast<std::size_t>(format.columns[i])];
  for (std::size_t i = 1; i < count.size(); ++i)
    if (count[i] > 1) return "names a column twice";
  const auto has = [&](Column column) { return count[static_cast<std::size_t>(column)] == 1; };

  const int cartesian = has(Column::X) + has(Column::Y) + has(Column::Z);
  const int heights = has(Column::Elevation) + has(Column::Zenith);
  const int spherical = has(Column::Range) + has(Column::Azimuth) + heights;
  if (cartesian > 0 && spherical > 0)
    return "has x, y, z and spherical coordinates: name the columns of one kind \"-\"";
  if (heights == 2) return "has elevation and zenith: name one of them \"-\"";
  if (cartesian != 3 && spherical != 3)
    return "needs x, y, z, or range, azimuth, elevation (or zenith)";
  if (format.separator == format.decimal_sign) return "has one sign as separator and decimal sign";

  return {};
}

tl::expected<TrackerLine, LineFault> decode(std::string_view line,
                                            const LineFormat& format) ABBE_RT {
  TrackerLine decoded;
  Values values{};
  const auto fault = decode_columns(
      line, format, [&](std::size_t i) { return use_of(format.columns[i]); },
      [&](std::string_view field, std::size_t i) {
        return read_coordinate(field, format.columns[i], format, values);
      },
      decoded);
  if (fault) return tl::unexpected{*fault};

  decoded.p_tracker_m = position(values, format);
  return decoded;
}

std::string_view name_of(Column column) ABBE_RT {
  switch (column) {
    case Column::Ignored:
      return "-";
    case Column::X:
      return "x";
    case Column::Y:
      return "y";
    case Column::Z:
      return "z";
    case Column::Range:
      return "range";
    case Column::Azimuth:
      return "azimuth";
    case Column::Elevation:
      return "elevation";
    case Column::Zenith:
      return "zenith";
    case Column::Time:
      return "time";
    case Column::Status:
      return "status";
  }
  return "?";
}

std::string_view column_name(const LineFormat& format, std::size_t index) ABBE_RT {
  return name_of(format.columns[index]);
}

}  // namespace abbe::protocol::lines

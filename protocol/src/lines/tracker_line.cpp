#include "abbe/protocol/lines/tracker_line.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>
#include <system_error>

#include "abbe/protocol/lines/fields.hpp"

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

bool is_digit(char c) noexcept {
  return c >= '0' && c <= '9';
}

int digits_of(TimeUnit unit) noexcept {
  switch (unit) {
    case TimeUnit::Seconds:
      return 9;
    case TimeUnit::Milliseconds:
      return 6;
    case TimeUnit::Microseconds:
      return 3;
    case TimeUnit::Nanoseconds:
      break;
  }
  return 0;
}

/// Adds a decimal digit; false: the result does not fit.
bool append_digit(std::int64_t& value, int digit) noexcept {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max() / 2;
  if (value > (kMost - digit) / 10) return false;
  value = 10 * value + digit;
  return true;
}

/// Reads the digits, without a detour over double: since 1970 there are 1.8e18 ns, of which a
/// double resolves 256 ns.
tl::expected<DeviceTime, What> time(std::string_view text, const LineFormat& format) noexcept {
  const bool negative = !text.empty() && text.front() == '-';
  if (!text.empty() && (text.front() == '-' || text.front() == '+')) text.remove_prefix(1);
  const int places = digits_of(format.time_unit);
  std::int64_t ns = 0;
  std::size_t digits = 0;
  int fraction = -1;  // digits after the decimal sign; -1: none was read yet

  for (const char c : text) {
    if (c == format.decimal_sign && fraction < 0) {
      fraction = 0;
      continue;
    }
    if (!is_digit(c)) return tl::unexpected{What::NotANumber};
    ++digits;
    if (fraction >= 0 && ++fraction > places) continue;  // below a nanosecond
    if (!append_digit(ns, c - '0')) return tl::unexpected{What::OutOfRange};
  }

  if (digits == 0) return tl::unexpected{What::NotANumber};
  for (int i = std::max(fraction, 0); i < places; ++i)
    if (!append_digit(ns, 0)) return tl::unexpected{What::OutOfRange};

  return DeviceTime{std::chrono::nanoseconds{negative ? -ns : ns}};
}

std::int32_t status_number(std::string_view text) noexcept {
  std::int32_t value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = read.ec == std::errc{} && read.ptr == text.data() + text.size();
  return whole ? value : 0;
}

bool is_valid_status(std::string_view text, const LineFormat& format) noexcept {
  for (std::size_t i = 0; i < format.valid_status_count; ++i)
    if (format.valid_status[i].text() == text) return true;
  return false;
}

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

std::optional<StatusWord> StatusWord::from(std::string_view text) ABBE_RT {
  if (text.empty() || text.size() > kCapacity) return std::nullopt;
  StatusWord word;
  std::copy(text.begin(), text.end(), word.bytes.begin());
  word.length = static_cast<std::uint8_t>(text.size());
  return word;
}

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
  const auto fault = [](What what, std::size_t column) {
    return tl::unexpected{LineFault{what, static_cast<std::uint8_t>(column)}};
  };
  TrackerLine decoded;
  Values values{};
  Fields fields{line, format.separator};

  for (std::size_t i = 0; i < format.column_count; ++i) {
    const auto field = fields.next();
    if (!field) return fault(What::MissingColumn, i + 1);
    switch (const Column column = format.columns[i]) {
      case Column::Ignored:
        break;
      case Column::Time: {
        const auto at = time(*field, format);
        if (!at) return fault(at.error(), i + 1);
        decoded.time = *at;
        break;
      }
      case Column::Status:
        decoded.status = status_number(*field);
        decoded.valid = is_valid_status(*field, format);
        break;
      default:
        if (const auto what = read_coordinate(*field, column, format, values))
          return fault(*what, i + 1);
    }
  }

  // A separator after the last column is not a column.
  if (const auto more = fields.next(); more && !more->empty())
    return fault(What::TooManyColumns, format.column_count + 1);
  decoded.p_tracker_m = position(values, format);
  return decoded;
}

bool is_comment(std::string_view line) ABBE_RT {
  const auto begin = line.find_first_not_of(" \t");
  return begin == std::string_view::npos || line[begin] == '#';
}

bool is_heading(std::string_view line) ABBE_RT {
  return std::none_of(line.begin(), line.end(), is_digit);
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

std::string_view text_of(What what) ABBE_RT {
  switch (what) {
    case What::MissingColumn:
      return "missing";
    case What::TooManyColumns:
      return "more columns than configured";
    case What::NotANumber:
      return "not a number";
    case What::OutOfRange:
      return "impossible in the configured unit";
    case What::TooLong:
      return "longer than 512 bytes";
  }
  return "?";
}

}  // namespace abbe::protocol::lines

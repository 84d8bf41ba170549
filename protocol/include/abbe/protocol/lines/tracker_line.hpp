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
#include <optional>
#include <string_view>
#include <tl/expected.hpp>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

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

/// Unit of a time column.
enum class TimeUnit : std::uint8_t { Seconds, Milliseconds, Microseconds, Nanoseconds };

/// A word of the status column, at most kCapacity bytes.
struct StatusWord {
  static constexpr std::size_t kCapacity = 15;
  std::array<char, kCapacity> bytes{};
  std::uint8_t length = 0;

  /// nullopt: `text` is empty or too long.
  [[nodiscard]] static std::optional<StatusWord> from(std::string_view text) ABBE_RT;
  [[nodiscard]] std::string_view text() const ABBE_RT { return {bytes.data(), length}; }
};

struct LineFormat {
  static constexpr std::size_t kMostColumns = 32;
  static constexpr std::size_t kMostWords = 8;

  std::array<Column, kMostColumns> columns{};
  std::size_t column_count = 0;
  /// Between two columns. ' ': any number of spaces and tabs. With another separator spaces around
  /// a column are ignored.
  char separator = ' ';
  char decimal_sign = '.';  ///< '.' or ','; differs from `separator`
  double metres_per_length = 1e-3;
  double radians_per_angle = 1.0;
  TimeUnit time_unit = TimeUnit::Seconds;
  /// The status of a point that may be used; every other status is that of an invalid point.
  std::array<StatusWord, kMostWords> valid_status{};
  std::size_t valid_status_count = 0;

  [[nodiscard]] bool has(Column column) const ABBE_RT;
};

/// What is wrong with a format: columns that are missing, double, or exclude each other. Empty: the
/// format is valid.
[[nodiscard]] std::string_view format_fault(const LineFormat& format) ABBE_RT;

/// Coordinates, m. A line with a larger one is refused: its unit is not the configured one.
inline constexpr double kLargestCoordinate_m = 1000.0;

struct TrackerLine {
  std::array<double, 3> p_tracker_m{};
  std::optional<DeviceTime> time;  ///< nullopt: the format has no time column
  std::int32_t status = 0;         ///< the number of the status column; 0 if it is a word
  bool valid = true;               ///< by its status
};

struct LineFault {
  enum class What : std::uint8_t {
    MissingColumn,   ///< the line ends before this column
    TooManyColumns,  ///< there is text after the last column
    NotANumber,
    OutOfRange,  ///< impossible as coordinate, angle or time in the configured unit
    TooLong,     ///< see kMaxLine
  };
  What what = What::NotANumber;
  std::uint8_t column = 0;  ///< from 1; 0: the whole line
};

[[nodiscard]] tl::expected<TrackerLine, LineFault> decode(std::string_view line,
                                                          const LineFormat& format) ABBE_RT;

/// A line that begins with '#' is a comment.
[[nodiscard]] bool is_comment(std::string_view line) ABBE_RT;
/// A line without a digit cannot be a point: the names of the columns that some programs print
/// first.
[[nodiscard]] bool is_heading(std::string_view line) ABBE_RT;

/// "x", "azimuth", ...: as in the configuration.
[[nodiscard]] std::string_view name_of(Column column) ABBE_RT;
/// "not a number", ...
[[nodiscard]] std::string_view text_of(LineFault::What what) ABBE_RT;

}  // namespace abbe::protocol::lines

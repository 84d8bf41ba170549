#pragma once
/// What all lines of text with columns have in common: separators, the unit of a time, the words of
/// a status, and what can be wrong with a line. Pure, real time, thread-safe.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::protocol::lines {

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

/// What a column is for.
enum class ColumnUse : std::uint8_t { Ignored, Value, Time, Status };

struct LineSyntax {
  static constexpr std::size_t kMostColumns = 32;
  static constexpr std::size_t kMostWords = 8;

  std::size_t column_count = 0;
  /// Between two columns. ' ': any number of spaces and tabs. With another separator spaces around
  /// a column are ignored.
  char separator = ' ';
  char decimal_sign = '.';  ///< '.' or ','; differs from `separator`
  TimeUnit time_unit = TimeUnit::Seconds;
  /// The status of a line whose values may be used; every other status makes them invalid.
  std::array<StatusWord, kMostWords> valid_status{};
  std::size_t valid_status_count = 0;
};

/// What a line has besides its values.
struct LineMarks {
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

/// A line that begins with '#' is a comment.
[[nodiscard]] bool is_comment(std::string_view line) ABBE_RT;
/// A line without a digit has no values: the names of the columns that some programs print first.
[[nodiscard]] bool is_heading(std::string_view line) ABBE_RT;

/// "not a number", ...
[[nodiscard]] std::string_view text_of(LineFault::What what) ABBE_RT;

}  // namespace abbe::protocol::lines

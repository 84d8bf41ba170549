#pragma once
/// Named values as a line of text, such as the positions of axes or the temperatures of sensors:
///
///   1764571234.502 1523.1042 -310.5518 88.1207 0
///
/// Each column is a value with a unit, the time, the status, or ignored. The decoder returns SI
/// units, and refuses a line that does not fit with the column at fault. Pure, real time,
/// thread-safe.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "abbe/protocol/lines/line_format.hpp"
#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::lines {

/// value [SI] = number * scale + offset.
struct ValueColumn {
  ColumnUse use = ColumnUse::Ignored;
  std::uint8_t value = 0;  ///< Value: index in ValueLine::value
  double scale = 1.0;
  double offset = 0.0;
  /// Largest magnitude, SI; a line with a larger one is refused: its unit is not the configured
  /// one.
  double limit = 0.0;
};

struct ValueFormat : LineSyntax {
  static constexpr std::size_t kMostValues = 16;

  std::array<ValueColumn, kMostColumns> columns{};
  std::array<std::string, kMostColumns> names{};  ///< of the columns, for messages
  std::size_t value_count = 0;
  /// Words in place of a number: this value is not known now.
  std::array<StatusWord, kMostWords> no_value{};
  std::size_t no_value_count = 0;

  [[nodiscard]] bool has(ColumnUse use) const ABBE_RT;
};

/// What is wrong with a format: no value, a value, time or status twice. Empty: the format is
/// valid.
[[nodiscard]] std::string_view format_fault(const ValueFormat& format) ABBE_RT;

struct ValueLine : LineMarks {
  std::array<double, ValueFormat::kMostValues> value{};  ///< NaN: not known
};

[[nodiscard]] tl::expected<ValueLine, LineFault> decode(std::string_view line,
                                                        const ValueFormat& format) ABBE_RT;

/// Of column `index`, from 0.
[[nodiscard]] std::string_view column_name(const ValueFormat& format, std::size_t index) ABBE_RT;

}  // namespace abbe::protocol::lines

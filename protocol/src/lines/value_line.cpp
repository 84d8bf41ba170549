#include "abbe/protocol/lines/value_line.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "abbe/protocol/lines/fields.hpp"
#include "decode_columns.hpp"

namespace abbe::protocol::lines {
namespace {

std::optional<LineFault::What> read_value(std::string_view field, const ValueColumn& column,
                                          const ValueFormat& format, ValueLine& line) noexcept {
  double& value = line.value[column.value];
  if (is_one_of(std::span{format.no_value}.first(format.no_value_count), field)) {
    value = std::numeric_limits<double>::quiet_NaN();
    return std::nullopt;
  }

  const auto read = number(field, format.decimal_sign);
  if (!read) return LineFault::What::NotANumber;
  value = *read * column.scale + column.offset;
  if (!(std::abs(value) <= column.limit)) return LineFault::What::OutOfRange;
  return std::nullopt;
}

}  // namespace

bool ValueFormat::has(ColumnUse use) const ABBE_RT {
  const auto end = columns.begin() + static_cast<std::ptrdiff_t>(column_count);
  return std::any_of(columns.begin(), end,
                     [use](const ValueColumn& column) { return column.use == use; });
}

std::string_view format_fault(const ValueFormat& format) ABBE_RT {
  if (format.column_count > ValueFormat::kMostColumns) return "has too many columns";
  if (format.value_count > ValueFormat::kMostValues) return "has too many values";
  std::array<int, ValueFormat::kMostValues> values{};
  int times = 0, states = 0;

  for (std::size_t i = 0; i < format.column_count; ++i) {
    const ValueColumn& column = format.columns[i];
    times += column.use == ColumnUse::Time ? 1 : 0;
    states += column.use == ColumnUse::Status ? 1 : 0;
    if (column.use != ColumnUse::Value) continue;
    if (column.value >= format.value_count) return "has a value that is not counted";
    ++values[column.value];
  }

  if (times > 1 || states > 1) return "names a column twice";
  if (format.value_count == 0) return "has no column with a value";
  for (std::size_t i = 0; i < format.value_count; ++i)
    if (values[i] != 1) return values[i] > 1 ? "names a column twice" : "misses a column";
  if (format.separator == format.decimal_sign) return "has one sign as separator and decimal sign";
  return {};
}

tl::expected<ValueLine, LineFault> decode(std::string_view line,
                                          const ValueFormat& format) ABBE_RT {
  ValueLine decoded;
  const auto fault = decode_columns(
      line, format, [&](std::size_t i) { return format.columns[i].use; },
      [&](std::string_view field, std::size_t i) {
        return read_value(field, format.columns[i], format, decoded);
      },
      decoded);
  if (fault) return tl::unexpected{*fault};
  return decoded;
}

std::string_view column_name(const ValueFormat& format, std::size_t index) ABBE_RT {
  return format.names[index];
}

}  // namespace abbe::protocol::lines

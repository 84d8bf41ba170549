#pragma once
/// Decodes the columns of a line in their order: time and status here, values by the caller. Real
/// time.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <tl/expected.hpp>

#include "abbe/protocol/lines/fields.hpp"
#include "abbe/protocol/lines/line_format.hpp"

namespace abbe::protocol::lines {

/// A time on the clock of the sender.
[[nodiscard]] tl::expected<DeviceTime, LineFault::What> decode_time(
    std::string_view text, const LineSyntax& syntax) ABBE_RT;

[[nodiscard]] bool is_one_of(std::span<const StatusWord> words, std::string_view text) ABBE_RT;

void decode_status(std::string_view text, const LineSyntax& syntax, LineMarks& marks) ABBE_RT;

/// `use_of(i)` is the ColumnUse of column i; `read_value(text, i)` returns the LineFault::What of a
/// value that cannot be read, or nullopt. Returns the first fault of the line, or nullopt.
template <class UseOf, class ReadValue>
[[nodiscard]] std::optional<LineFault> decode_columns(std::string_view line,
                                                      const LineSyntax& syntax, UseOf use_of,
                                                      ReadValue read_value,
                                                      LineMarks& marks) noexcept {
  const auto fault = [](LineFault::What what, std::size_t column) {
    return LineFault{what, static_cast<std::uint8_t>(column)};
  };
  Fields fields{line, syntax.separator};

  for (std::size_t i = 0; i < syntax.column_count; ++i) {
    const auto field = fields.next();
    if (!field) return fault(LineFault::What::MissingColumn, i + 1);
    switch (use_of(i)) {
      case ColumnUse::Ignored:
        break;
      case ColumnUse::Value:
        if (const auto what = read_value(*field, i)) return fault(*what, i + 1);
        break;
      case ColumnUse::Time: {
        const auto at = decode_time(*field, syntax);
        if (!at) return fault(at.error(), i + 1);
        marks.time = *at;
        break;
      }
      case ColumnUse::Status:
        decode_status(*field, syntax, marks);
        break;
    }
  }

  // A separator after the last column is not a column.
  if (const auto more = fields.next(); more && !more->empty())
    return fault(LineFault::What::TooManyColumns, syntax.column_count + 1);
  return std::nullopt;
}

}  // namespace abbe::protocol::lines

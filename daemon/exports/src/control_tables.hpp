#pragma once
/// Interpolates the tables of controls, and parses the texts from which controls read them.

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/exports/control_reading.hpp"

namespace abbe::daemon {

/// A position and a value, both in the unit of the file.
struct TablePoint {
  double position = 0.0, value = 0.0;
};

/// The table's value at `position`: a straight line between points with ascending positions; beyond
/// the first or last point the value of this point.
[[nodiscard]] double on_table(std::span<const TablePoint> points, double position);
/// The reason why a control cannot use the points: there are fewer than 2, or their positions do
/// not ascend. Empty: it can use them.
[[nodiscard]] std::string table_fault(std::span<const TablePoint> points);

/// A line with its number. A comment, which begins with `comment`, is removed (empty: the format
/// has no comments).
struct TextLine {
  std::size_t number = 0;
  std::string_view text;
};
[[nodiscard]] std::vector<TextLine> lines_of(std::string_view text, std::string_view comment);
/// The words of the line, separated by blanks, tabs and carriage returns.
[[nodiscard]] std::vector<std::string_view> words_of(std::string_view line);
/// The whole text as a decimal number of at most 1e6; nullopt otherwise.
[[nodiscard]] std::optional<double> plain_number(std::string_view text);
/// The Error BadInput with the text "NAME:LINE: what".
[[nodiscard]] tl::unexpected<Error> at_line(const std::string& file, std::size_t line,
                                            std::string what);

/// Index of an axis by its name; nullopt if the control has no such axis.
[[nodiscard]] std::optional<std::size_t> axis_named(const ControlSettings&, std::string_view name);

[[nodiscard]] Result<ControlCorrection> read_linuxcnc(std::span<const ExportFile>);
[[nodiscard]] Result<ControlCorrection> read_sinumerik_cec(const ExportFile&,
                                                           const ControlSettings&);
[[nodiscard]] Result<ControlCorrection> read_sinumerik_lec(const ExportFile&,
                                                           const ControlSettings&);
[[nodiscard]] Result<ControlCorrection> read_com_tables(std::span<const ExportFile>,
                                                        const ControlSettings&);
[[nodiscard]] Result<ControlCorrection> read_isg_csv(const ExportFile&, const ControlSettings&);
[[nodiscard]] Result<ControlCorrection> read_etalon(const ExportFile&, const ControlSettings&);
[[nodiscard]] Result<ControlCorrection> read_csv_grid(const ExportFile&);

}  // namespace abbe::daemon

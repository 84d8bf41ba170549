// Reads lists of points; point_export_use.cpp converts them.
#include "abbe/tables/point_export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>

#include "abbe/base/sha256.hpp"
#include "abbe/tables/length_unit.hpp"
#include "text_lines.hpp"
#include "time_stamp.hpp"

namespace abbe::daemon {
namespace {

enum class PointColumn { Collection, Group, Name, X, Y, Z, Time, Seconds, Other };

constexpr std::string_view kWriteHeading =
    "add a first line that names the columns, such as Name,X,Y,Z (also Collection, Group, "
    "Time (s); others are not used)";

bool is_comment_line(std::string_view line) {
  return line.starts_with("//") || line.starts_with('#');
}

std::string_view content_of_comment(std::string_view line) {
  return without_blanks(line.substr(std::min(line.find_first_not_of("/#"), line.size())));
}

char separator_of_points(std::string_view line) {
  for (const char separator : {';', '\t', ','})
    if (line.find(separator) != std::string_view::npos) return separator;
  return ' ';
}

/// The text in the last brackets: "mm" in "X (mm)". Empty if there are no brackets.
std::string_view in_brackets(std::string_view text) {
  const auto open = text.find_last_of("([");
  const auto close = text.find_last_of(")]");
  if (open == std::string_view::npos || close == std::string_view::npos || close < open) return {};
  return without_blanks(text.substr(open + 1, close - open - 1));
}

/// The unit as a word of metres_per(); empty for an unknown text.
std::string_view unit_word(std::string_view text) {
  const std::string unit = in_lower_case(text);
  if (unit == "mm" || unit == "millimeters" || unit == "millimetres") return "mm";
  if (unit == "m" || unit == "meters" || unit == "metres") return "m";
  if (unit == "in" || unit == "inch" || unit == "inches" || unit == "\"") return "inch";
  if (unit == "cm" || unit == "centimeters" || unit == "centimetres") return "cm";
  if (unit == "ft" || unit == "feet") return "feet";
  return {};
}

PointColumn column_named(std::string_view text) {
  std::string name = in_lower_case(without_blanks(text.substr(0, text.find_first_of("(["))));
  const bool in_seconds = in_brackets(text) == "s" || name == "time_s";
  if (name == "x") return PointColumn::X;
  if (name == "y") return PointColumn::Y;
  if (name == "z") return PointColumn::Z;
  if (name == "collection") return PointColumn::Collection;
  if (name == "group" || name == "group name") return PointColumn::Group;
  for (const std::string_view word : {"name", "point", "point name", "target", "target name"})
    if (name == word) return PointColumn::Name;
  for (const std::string_view word : {"time", "time_s", "timestamp", "time stamp"})
    if (name == word) return in_seconds ? PointColumn::Seconds : PointColumn::Time;
  return PointColumn::Other;
}

/// The columns of a heading. Empty if the fields are not a heading, which contains X, Y and Z, each
/// once.
std::vector<PointColumn> columns_of_heading(const std::vector<std::string_view>& fields) {
  std::vector<PointColumn> columns;
  for (const auto field : fields) columns.push_back(column_named(field));
  for (const PointColumn axis : {PointColumn::X, PointColumn::Y, PointColumn::Z})
    if (std::ranges::count(columns, axis) != 1) return {};
  return columns;
}

/// Joins a date and the following time of day, which are separated by blanks, into one field.
void join_stamps(std::vector<std::string_view>& fields) {
  for (std::size_t i = 0; i + 1 < fields.size(); ++i) {
    const char* const begin = fields[i].data();
    const char* const end = fields[i + 1].data() + fields[i + 1].size();
    const std::string_view both(begin, static_cast<std::size_t>(end - begin));
    if (!seconds_of_stamp(both)) continue;
    fields[i] = both;
    fields.erase(fields.begin() + static_cast<std::ptrdiff_t>(i) + 1);
  }
}

/// The columns of a row without a heading; empty if they are ambiguous. `fields` does not contain
/// the time.
std::vector<PointColumn> columns_of_row(const std::vector<std::string_view>& fields) {
  using enum PointColumn;
  constexpr std::size_t kFewest = 3, kMost = 6;
  const std::array<PointColumn, kMost> all{Collection, Group, Name, X, Y, Z};
  if (fields.size() < kFewest || fields.size() > kMost) return {};
  // With more than four numbers it is not clear which of them are the coordinates.
  const std::size_t names = fields.size() - kFewest;
  for (std::size_t i = 0; i + 1 < names; ++i)
    if (is_number_field(fields[i])) return {};
  return {all.end() - static_cast<std::ptrdiff_t>(fields.size()), all.end()};
}

class PointRows {
 public:
  PointRows(std::string_view text, double metres, Faults& faults)
      : lines_(text), metres_(metres), faults_(faults) {}

  void read() {
    while (lines_.next()) is_comment_line(lines_.line()) ? read_comment() : read_row();
    if (points_.empty() && !faults_.any()) faults_.add(lines_.number(), 1, "", "has no points");
  }
  [[nodiscard]] std::vector<ExportedPoint> take() { return std::move(points_); }
  [[nodiscard]] std::size_t last_line() const { return lines_.number(); }

 private:
  void read_comment() {
    const auto content = content_of_comment(lines_.line());
    const auto columns = columns_of_heading(fields_of(content, separator_of_points(content)));
    if (!columns.empty() && points_.empty()) heading_ = columns;
    const bool polar =
        content.starts_with("AXES") && content.find("CARTESIAN") == std::string_view::npos;
    if (polar)
      faults_.add(lines_.number(), 1, "AXES", "the coordinates are not Cartesian: export X, Y, Z");
  }

  void read_row() {
    if (separator_ == '\0') separator_ = separator_of_points(lines_.line());
    auto fields = fields_of(lines_.line(), separator_);
    while (fields.size() > heading_.size() && fields.back().empty()) fields.pop_back();
    if (points_.empty() && heading_.empty()) {
      heading_ = columns_of_heading(fields);
      if (!heading_.empty()) return;
    }
    join_stamps(fields);
    add_point(fields);
  }

  void add_point(std::vector<std::string_view>& fields) {
    ExportedPoint point;
    point.line = lines_.number();
    const bool time_behind = !fields.empty() && seconds_of_stamp(fields.back()).has_value() &&
                             (heading_.empty() || fields.size() == heading_.size() + 1);
    if (time_behind) {
      point.time_s = seconds_of_stamp(fields.back());
      fields.pop_back();
    }

    const auto columns = heading_.empty() ? columns_of_row(fields) : heading_;
    if (columns.empty())
      return faults_.add_kind(
          "columns", lines_.number(), 1, "",
          fmt::format("what the {} columns are is not clear: {}", fields.size(), kWriteHeading));
    if (columns.size() != fields.size())
      return faults_.add_kind("values", lines_.number(), 1, "",
                              fmt::format("{} values, expected {}: names and numbers must not "
                                          "contain the separator, here {}",
                                          fields.size(), columns.size(), name_of_separator()));
    for (std::size_t i = 0; i < fields.size(); ++i) take_field(columns[i], fields[i], point);
    check_repeated(point);
    points_.push_back(std::move(point));
  }

  [[nodiscard]] std::string_view name_of_separator() const {
    switch (separator_) {
      case ';':
        return "semicolons";
      case ',':
        return "commas";
      case '\t':
        return "tabs";
      default:
        return "blanks";
    }
  }

  void take_field(PointColumn column, std::string_view field, ExportedPoint& point) {
    switch (column) {
      case PointColumn::Collection:
        point.group = std::string(field) + (point.group.empty() ? "" : "::") + point.group;
        break;
      case PointColumn::Group:
        point.group += (point.group.empty() ? "" : "::") + std::string(field);
        break;
      case PointColumn::Name:
        point.name = field;
        break;
      case PointColumn::X:
        point.p_m.x() = metres_ * number(field, "X");
        break;
      case PointColumn::Y:
        point.p_m.y() = metres_ * number(field, "Y");
        break;
      case PointColumn::Z:
        point.p_m.z() = metres_ * number(field, "Z");
        break;
      case PointColumn::Seconds:
        point.time_s = number(field, "Time");
        break;
      case PointColumn::Time:
        take_stamp(field, point);
        break;
      case PointColumn::Other:
        break;
    }
  }

  double number(std::string_view field, std::string_view name) {
    double value = 0.0;
    if (const auto fault = number_fault(field, value); !fault.empty())
      faults_.add_kind("number", lines_.number(), lines_.column(field), name, fault);
    return value;
  }

  void take_stamp(std::string_view field, ExportedPoint& point) {
    point.time_s = seconds_of_stamp(field);
    if (!point.time_s)
      faults_.add_kind("time", lines_.number(), lines_.column(field), "Time",
                       fmt::format("\"{}\": must be a date with a time, such as 05/28/19 "
                                   "18:01:15.250 (month first); seconds have the heading Time (s)",
                                   protocol::printable_line(field)));
  }

  void check_repeated(const ExportedPoint& point) {
    if (point.name.empty()) return;
    const auto [at, is_new] = line_of_.try_emplace(point.group + '\n' + point.name, point.line);
    if (!is_new)
      faults_.add_kind("repeated", point.line, 1, "Name",
                       fmt::format("point \"{}\" of this group is also in line {}",
                                   protocol::printable_line(point.name), at->second));
  }

  TextLines lines_;
  double metres_;
  Faults& faults_;
  char separator_ = '\0';
  std::vector<PointColumn> heading_;
  std::vector<ExportedPoint> points_;
  std::map<std::string, std::size_t> line_of_;
};

/// The unit in the brackets of a comment or heading; empty if there is none.
std::string_view unit_in(std::string_view line) {
  const auto content = is_comment_line(line) ? content_of_comment(line) : line;
  if (content.starts_with("AXES")) return in_brackets(content);
  for (const auto field : fields_of(content, separator_of_points(content)))
    if (column_named(field) == PointColumn::X && !in_brackets(field).empty())
      return in_brackets(field);
  return {};
}

}  // namespace

PointExportHeader point_export_header(std::string_view text) {
  PointExportHeader header;
  for (TextLines lines(text); lines.next();) {
    const auto line = lines.line();
    if (const auto unit = unit_in(line); !unit.empty()) header.unit = unit_word(unit);
    if (!is_comment_line(line)) break;
    const auto first = line.find('\''), last = line.rfind('\'');
    if (line.find("Coordinate Frame") != std::string_view::npos && last > first)
      header.frame = line.substr(first + 1, last - first - 1);
  }
  return header;
}

bool is_point_export(std::string_view text) {
  TextLines lines(text);
  while (lines.next()) {
    const auto line = lines.line();
    if (line.starts_with("//")) return true;
    if (line.starts_with('#')) continue;
    const auto fields = fields_of(line, separator_of_points(line));
    if (!columns_of_heading(fields).empty()) return true;
    if (fields.size() < 4 || is_number_field(fields[0])) return false;
    std::size_t numbers = 0;  // there must be at least three numbers in a row
    for (const auto field : fields) {
      numbers = is_number_field(field) ? numbers + 1 : 0;
      if (numbers == 3) return true;
    }
    return false;
  }
  return false;
}

Result<PointExport> parse_point_export(std::string_view text, const std::filesystem::path& file,
                                       std::string_view unit) {
  Faults faults(file.string());
  if (is_no_text(text, faults)) return tl::make_unexpected(faults.to_error());
  auto header = point_export_header(text);
  if (!header.unit.empty() && header.unit != unit)
    faults.add(1, 1, "",
               fmt::format("the file states its unit, {}, and the option another one, {}",
                           header.unit, unit));
  const auto metres = metres_per(unit);
  if (!metres) faults.add(1, 1, "", fmt::format("the unit {} is not read: export mm", unit));
  PointRows rows(text, metres.value_or(1.0), faults);
  rows.read();
  check_last_newline(text, rows.last_line(), faults);
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return PointExport{
      {file.filename().string(), sha256_hex(text)}, std::move(header.frame), rows.take()};
}

}  // namespace abbe::daemon

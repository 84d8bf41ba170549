// Converts exported points to the form of tracker.csv and verification.csv.
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "abbe/base/parsed_table.hpp"
#include "abbe/base/units.hpp"
#include "abbe/protocol/printable.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/point_export.hpp"
#include "repeated_points.hpp"

namespace abbe::daemon {
namespace {

void check_export_times(const std::vector<ExportedPoint>& points, Faults& faults) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].time_s)
      return faults.add(points[i].line, 1, "Time",
                        "no time: export time stamps with decimals of the second, or state the "
                        "rate of the points with --tracker-points-per-s");
    if (i > 0 && *points[i].time_s <= *points[i - 1].time_s)
      faults.add_kind("ascend", points[i].line, 1, "Time",
                      "not after that of the line before: stamps of whole seconds do not show when "
                      "a point was measured; state the rate with --tracker-points-per-s");
  }
}

/// Adds a fault if points seem to be missing: in a list without times, a missing point shifts all
/// times after it.
void check_no_point_missing(const std::vector<ExportedPoint>& points, Faults& faults) {
  constexpr double kLeast_m = 0.2e-3, kFactor = 3.0;
  const auto step_m = [&](std::size_t i) { return (points[i + 1].p_m - points[i].p_m).norm(); };
  for (std::size_t i = 1; i + 2 < points.size(); ++i) {
    const double here_m = step_m(i), beside_m = std::max(step_m(i - 1), step_m(i + 1));
    if (here_m > kLeast_m && here_m > kFactor * beside_m)
      faults.add_kind("missing", points[i + 1].line, 1, "",
                      fmt::format("{:.3f} mm after the point before, its neighbours are {:.3f} mm "
                                  "apart: points are missing, and without times their number is "
                                  "not known; export times",
                                  here_m * kMmPerM, beside_m * kMmPerM));
  }
}

using LinesOfNames = std::map<std::string_view, std::vector<std::size_t>>;

LinesOfNames indices_of_names(const std::vector<ExportedPoint>& points) {
  LinesOfNames names;
  for (std::size_t i = 0; i < points.size(); ++i) names[points[i].name].push_back(i);
  return names;
}

calib::Vector3 reading_in(const NumberTable& table, std::size_t row, std::size_t first) {
  return {table.at(row, first) / kMmPerM, table.at(row, first + 1) / kMmPerM,
          table.at(row, first + 2) / kMmPerM};
}

/// Sets the reading of each point by its name. Returns the line of each name.
void take_named(ParsedTable& readings, const std::vector<std::string_view>& words,
                const LinesOfNames& names, const PointExport& exported, VerificationFile& out) {
  auto& [source, table, faults] = readings;
  std::map<std::string_view, std::size_t> line_of;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (!table.sound(row)) continue;
    const auto name = words[static_cast<std::size_t>(table.at(row, 0))];
    const auto [at, is_new] = line_of.try_emplace(name, table.line(row));
    if (!is_new)
      faults.add_kind(
          "repeated", table.line(row), 1, "name",
          fmt::format("\"{}\" is also in line {}", protocol::printable_line(name), at->second));
    for (const std::size_t point : names.at(name))
      out.points[point].reading_m = reading_in(table, row, 1);
  }

  if (faults.any()) return;
  for (const ExportedPoint& point : exported.points)
    if (!line_of.contains(point.name))
      faults.add_kind(
          "no reading", 1, 1, "name",
          fmt::format("no row of point \"{}\" ({}, line {}): add it, or delete the point",
                      protocol::printable_line(point.name), exported.source.name, point.line));
}

void take_in_order(ParsedTable& readings, const PointExport& exported, VerificationFile& out) {
  auto& [source, table, faults] = readings;
  if (table.rows() != exported.points.size())
    return faults.add(1, 1, "",
                      fmt::format("{} readings, {} has {} points: rows without names are in the "
                                  "order of the points",
                                  table.rows(), exported.source.name, exported.points.size()));
  for (std::size_t row = 0; row < table.rows(); ++row)
    out.points[row].reading_m = reading_in(table, row, 0);
}

}  // namespace

Result<TrackerFile> tracker_of_export(const PointExport& points, const std::filesystem::path& file,
                                      std::optional<double> points_per_s) {
  Faults faults(file.string());
  const auto& all = points.points;
  points_per_s ? check_no_point_missing(all, faults) : check_export_times(all, faults);
  if (faults.any()) return tl::make_unexpected(faults.to_error());

  TrackerFile out{points.source, {}, {}};
  out.frame = TrackerFile::Frame::Unstated;
  out.times = {.first_time_s = points_per_s ? 0.0 : *all.front().time_s,
               .first_line = all.front().line,
               .last_line = all.back().line};
  out.points.reserve(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    calib::otf::TrackerObservation point;
    point.time_s = points_per_s ? static_cast<double>(i) / *points_per_s
                                : *all[i].time_s - out.times.first_time_s;
    point.valid = true;
    point.p_tracker_m = all[i].p_m;
    out.points.push_back(point);
  }
  return out;
}

Result<VerificationFile> verification_of_export(const PointExport& points,
                                                const std::filesystem::path& file,
                                                const std::filesystem::path& readings_file) {
  const auto names = indices_of_names(points.points);
  std::vector<std::string_view> words;
  for (const auto& [name, indices] : names)
    if (!name.empty()) words.push_back(name);
  const TableForm in_order{{"x_mm"}, {"y_mm"}, {"z_mm"}};
  const TableForm by_name{{.name = "name", .words = words}, {"x_mm"}, {"y_mm"}, {"z_mm"}};
  auto readings = parse_table(readings_file, {in_order, by_name});
  ABBE_TRY(readings);
  check_rows(*readings, 1, "readings");

  VerificationFile out{points.source};
  for (const ExportedPoint& point : points.points) {
    out.points.push_back({calib::Vector3::Zero(), point.p_m});
    out.lines.push_back(point.line);
  }

  constexpr std::size_t kNamed = 1;  // index of the variant of the file with names
  const bool named = readings->table.form() == kNamed;
  if (named && words.empty())
    readings->faults.add(1, 1, "name",
                         fmt::format("the points of {} have no names: leave out the column, rows "
                                     "are then in the order of the points",
                                     file.string()));
  else if (named)
    take_named(*readings, words, names, points, out);
  else
    take_in_order(*readings, points, out);
  if (readings->faults.any()) return tl::make_unexpected(readings->faults.to_error());
  out.readings = readings->source;
  leave_out_repeated(out);
  return out;
}

}  // namespace abbe::daemon

#include "abbe/tables/measured_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <tuple>

#include "abbe/base/parsed_table.hpp"
#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"
#include "whole_number.hpp"

namespace abbe::daemon {
namespace {

using calib::direct::MeasuredError;

enum MeasuredColumn : std::size_t { kName, kPosition, kValue, kUnit, kRun, kDirection, kLine };
constexpr double kMicroPerUnit = 1e6;  // um per m, urad per rad

/// The names of all errors by ISO 230-1. Squareness is also accepted without E, as in truth.csv.
std::vector<std::string> measured_names() {
  std::vector<std::string> names;
  for (const calib::Axis axis : calib::kAllAxes)
    for (const calib::Motion motion : calib::kAllMotions)
      names.push_back(calib::name({motion, axis}));
  for (const std::string_view squareness : calib::kSquarenessNames) {
    names.emplace_back(squareness);
    names.emplace_back(squareness.substr(1));
  }
  return names;
}

/// Collects the rows of each error.
class MeasuredRows {
 public:
  MeasuredRows(const NumberTable& table, Faults& faults)
      : table_(table), faults_(faults), names_(measured_names()) {}

  void read(std::size_t row) {
    if (!table_.sound(row)) return;
    std::string name = names_[static_cast<std::size_t>(table_.at(row, kName))];
    if (!name.starts_with('E')) name.insert(0, 1, 'E');
    const auto motion = calib::error_motion(name);
    check_unit(row, motion);
    MeasuredError& error = error_named(name);
    const calib::direct::Reading reading = reading_of(row, motion);
    check_repeated(row, name, reading);
    if (table_.has(kLine)) take_line(row, motion, error);
    error.readings.push_back(reading);
    lines_[static_cast<std::size_t>(&error - errors_.data())].push_back(table_.line(row));
  }

  [[nodiscard]] std::vector<MeasuredError> take() { return std::move(errors_); }
  [[nodiscard]] std::vector<std::vector<std::size_t>> take_lines() { return std::move(lines_); }

 private:
  void fault(std::size_t row, std::string_view column, std::string_view what) {
    faults_.add(table_.line(row), 1, column, what);
  }

  MeasuredError& error_named(const std::string& name) {
    const auto found = std::ranges::find(errors_, name, &MeasuredError::name);
    if (found != errors_.end()) return *found;
    lines_.emplace_back();
    return errors_.emplace_back(MeasuredError{.name = name, .readings = {}});
  }

  void check_unit(std::size_t row, const std::optional<calib::ErrorMotion>& motion) {
    const bool is_angle = !motion || calib::is_rotation(motion->motion);
    const bool given_as_angle = table_.at(row, kUnit) > 0.5;
    if (is_angle != given_as_angle)
      fault(row, "unit", is_angle ? "um for an angle: needs urad" : "urad for a length: needs um");
  }

  calib::direct::Reading reading_of(std::size_t row,
                                    const std::optional<calib::ErrorMotion>& motion) {
    const double position_mm = table_.at(row, kPosition), direction = table_.at(row, kDirection);
    if (motion && std::isnan(position_mm)) fault(row, "position_mm", "empty");
    if (motion && std::isnan(direction)) fault(row, "direction", "empty: needs + or -");
    return {.position_m = motion ? position_mm / kMmPerM : 0.0,
            .value = table_.at(row, kValue) / kMicroPerUnit,
            .run = number_at(table_, row, kRun, "run", faults_),
            .forward = !(direction > 0.5)};
  }

  void check_repeated(std::size_t row, const std::string& name,
                      const calib::direct::Reading& reading) {
    const auto target = std::llround(reading.position_m / calib::direct::kSameTarget_m);
    const auto [at, is_new] =
        seen_.try_emplace({name, reading.run, reading.forward, target}, table_.line(row));
    if (!is_new)
      faults_.add_kind("repeated", table_.line(row), 1, "run",
                       fmt::format("{} has a value for run {}, this direction and position in "
                                   "line {}: number repeated runs 1, 2, ...",
                                   name, reading.run, at->second));
  }

  void take_line(std::size_t row, const std::optional<calib::ErrorMotion>& motion,
                 MeasuredError& error) {
    constexpr double kSameLine_m = 1e-3;
    calib::Vector3 line_m = calib::Vector3::Zero();
    int given = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const double at_mm = table_.at(row, kLine + a);
      if ((motion && a == calib::index(motion->axis)) || std::isnan(at_mm)) continue;
      line_m(static_cast<Eigen::Index>(a)) = at_mm / kMmPerM;
      ++given;
    }

    const int wanted = motion ? 2 : 3;
    if (given != 0 && given != wanted)
      return fault(row, "x_mm",
                   motion ? "one axis of the measured line is empty: needs both or none"
                          : "the point where the lines of a squareness meet needs x, y and z");
    const std::optional<calib::Vector3> line =
        given == wanted ? std::optional(line_m) : std::nullopt;
    if (error.readings.empty()) error.line_m = line;
    const bool same = line.has_value() == error.line_m.has_value() &&
                      (!line || (*line - *error.line_m).norm() < kSameLine_m);
    if (!same)
      fault(row, "x_mm", "another measured line than in the rows before: one line per error");
  }

  const NumberTable& table_;
  Faults& faults_;
  std::vector<std::string> names_;
  std::vector<MeasuredError> errors_;
  std::vector<std::vector<std::size_t>> lines_;
  std::map<std::tuple<std::string, int, bool, long long>, std::size_t> seen_;
};

}  // namespace

Result<MeasuredFile> read_measured_csv(const std::filesystem::path& file) {
  const std::vector<std::string> names = measured_names();
  auto parsed =
      parse_table(file, {{{.name = "name", .words = {names.begin(), names.end()}},
                          {.name = "position_mm", .may_be_empty = true},
                          {"value"},
                          {"unit", true, {"um", "urad"}},
                          {"run"},
                          {.name = "direction", .words = {"+", "-"}, .may_be_empty = true},
                          {.name = "x_mm", .required = false, .may_be_empty = true},
                          {.name = "y_mm", .required = false, .may_be_empty = true},
                          {.name = "z_mm", .required = false, .may_be_empty = true}}});
  ABBE_TRY(parsed);
  check_rows(*parsed, 1, "values");
  auto& [source, table, faults] = *parsed;
  if (table.has(kLine) != table.has(kLine + 1) || table.has(kLine) != table.has(kLine + 2))
    faults.add(1, 1, "x_mm", "needs x_mm, y_mm and z_mm together");

  MeasuredRows rows(table, faults);
  for (std::size_t row = 0; row < table.rows(); ++row) rows.read(row);
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return MeasuredFile{source, rows.take(), rows.take_lines()};
}

}  // namespace abbe::daemon

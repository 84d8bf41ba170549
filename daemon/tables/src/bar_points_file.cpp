// Reads the touches of a Multi-Feature Bar.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <map>
#include <string_view>
#include <tuple>

#include "abbe/base/parsed_table.hpp"
#include "abbe/base/units.hpp"
#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/mfb_files.hpp"

namespace abbe::daemon {
namespace {

using calib::mfb::Bar;
using calib::mfb::Feature;
using calib::mfb::Measurement;
using calib::mfb::PassDirection;
using calib::mfb::PassTouches;
using calib::mfb::Side;
using calib::mfb::Target;

enum BarPointColumn : std::size_t { kMeasurement, kFeature, kIndex, kSide, kK, kX };

TableForm form_of_touches(const std::vector<Measurement>& measurements) {
  std::vector<std::string_view> names;
  for (const Measurement& m : measurements) names.emplace_back(m.name);
  return {{.name = "measurement", .words = std::move(names)},
          {.name = "feature", .words = {"hole", "rod", "plane"}},
          {"index"},
          {.name = "side", .words = {"L", "R"}, .may_be_empty = true},
          {"k"},
          {"x_mm"},
          {"y_mm"},
          {"z_mm"}};
}

/// Assigns the rows to the measurements.
class TouchRows {
 public:
  TouchRows(const NumberTable& table, const Bar& bar, const BarPlanFile& plan, Faults& faults)
      : table_(table),
        pattern_(bar.pattern),
        plan_(plan),
        faults_(faults),
        passes_(plan.plan.measurements.size()),
        lines_(passes_.size()) {}

  void read(std::size_t row) {
    const auto measurement = static_cast<std::size_t>(table_.at(row, kMeasurement));
    if (measurement < passes_.size()) rows_of_[measurement] = true;
    if (!table_.sound(row)) return;
    const auto target = target_of(row);
    if (!target) return;
    check_repeated(row, measurement, *target);
    passes_[measurement].push_back({.target = *target, .reading_m = reading_m(row)});
    lines_[measurement].push_back(table_.line(row));
  }

  /// Adds a fault for every measurement of the plan that has no row.
  void check_complete() {
    for (std::size_t i = 0; i < passes_.size(); ++i)
      if (!rows_of_.contains(i))
        faults_.add_kind(
            "no points", 1, 1, "measurement",
            fmt::format("no row of \"{}\" ({}, line {})", plan_.plan.measurements[i].name,
                        plan_.source.name, plan_.lines[i]));
  }
  [[nodiscard]] std::vector<PassTouches> take() { return std::move(passes_); }
  [[nodiscard]] std::vector<std::vector<std::size_t>> take_lines() { return std::move(lines_); }

 private:
  calib::Vector3 reading_m(std::size_t row) const {
    return {table_.at(row, kX) / kMmPerM, table_.at(row, kX + 1) / kMmPerM,
            table_.at(row, kX + 2) / kMmPerM};
  }

  /// The cell as a whole number from `least` to `most`; nullopt after a fault.
  std::optional<std::size_t> whole(std::size_t row, std::size_t column, std::string_view name,
                                   std::size_t least, std::size_t most, std::string_view of) {
    const double value = table_.at(row, column);
    if (value == std::floor(value) && value >= static_cast<double>(least) &&
        value <= static_cast<double>(most))
      return static_cast<std::size_t>(value);
    faults_.add_kind(of, table_.line(row), 1, name,
                     fmt::format("{}: a {} has {} to {}", value, of, least, most));
    return std::nullopt;
  }

  std::optional<Target> target_of(std::size_t row) {
    constexpr std::array<std::string_view, 3> kNames{"hole", "rod", "plane"};
    const auto kind = static_cast<std::size_t>(table_.at(row, kFeature));
    const auto feature = static_cast<Feature>(kind);
    const std::size_t features = pattern_.holes() - (feature == Feature::Hole ? 0 : 1);
    const auto index = whole(row, kIndex, "index", 1, features, kNames.at(kind));
    const auto k = whole(row, kK, "k", 0, pattern_.touches_of(feature) - 1, kNames.at(kind));
    const auto side = side_of(row, feature);
    if (!index || !k || !side) return std::nullopt;
    return Target{.feature = feature, .index = *index - 1, .side = *side, .k = *k};
  }

  std::optional<Side> side_of(std::size_t row, Feature feature) {
    const double value = table_.at(row, kSide);
    const bool given = !std::isnan(value), plane = feature == Feature::Plane;
    if (given == plane) return plane && value > 0.5 ? Side::Right : Side::Left;
    faults_.add(table_.line(row), 1, "side",
                plane ? "empty: a plane needs L or R" : "must be empty for a hole or rod");
    return std::nullopt;
  }

  void check_repeated(std::size_t row, std::size_t measurement, const Target& target) {
    const auto [at, is_new] = seen_.try_emplace(
        {measurement, target.feature, target.index, target.side, target.k}, table_.line(row));
    if (!is_new)
      faults_.add_kind("repeated", table_.line(row), 1, "k",
                       fmt::format("{} of \"{}\" is also in line {}", calib::mfb::name(target),
                                   plan_.plan.measurements[measurement].name, at->second));
  }

  const NumberTable& table_;
  const calib::mfb::TouchPattern& pattern_;
  const BarPlanFile& plan_;
  Faults& faults_;
  std::vector<PassTouches> passes_;
  std::vector<std::vector<std::size_t>> lines_;
  std::map<std::size_t, bool> rows_of_;
  std::map<std::tuple<std::size_t, Feature, std::size_t, Side, std::size_t>, std::size_t> seen_;
};

/// The travel, extended by half a cell at each end, because touches extend beyond the points of the
/// bar.
calib::MachineNodes widened(calib::MachineNodes nodes) {
  for (auto& axis : nodes) {
    auto& at = axis.nodes_m;
    const std::size_t n = at.size();
    if (n < 2) continue;
    const double first = 0.5 * (at[1] - at[0]), last = 0.5 * (at[n - 1] - at[n - 2]);
    at.front() -= first;
    at.back() += last;
  }
  return nodes;
}

void check_readings(const NumberTable& table, const calib::MachineNodes& nodes, Faults& faults) {
  constexpr std::array kColumns{"x_mm", "y_mm", "z_mm"};
  std::vector<calib::Vector3> readings_m;
  for (std::size_t row = 0; row < table.rows(); ++row)
    readings_m.emplace_back(table.at(row, kX) / kMmPerM, table.at(row, kX + 1) / kMmPerM,
                            table.at(row, kX + 2) / kMmPerM);
  const auto travel = widened(nodes);
  const auto outside = calib::outside_travel(readings_m, travel);
  if (outside.empty()) return;

  // With a wrong axis or unit most readings are outside the travel; with a bar that is too long,
  // only some are.
  const bool most = 2 * outside.size() > readings_m.size();
  const std::string fits = most ? calib::corrections_inside_travel(readings_m, travel) : "";
  for (const auto& [row, axis] : outside) {
    if (!table.sound(row)) continue;
    const auto& nodes_m = nodes[axis].nodes_m;
    faults.add_kind("travel", table.line(row), 1, kColumns[axis],
                    fmt::format("{:g}: more than half a node spacing outside the nodes of {}, {:g} "
                                "to {:g} mm{}",
                                table.at(row, kX + axis), "XYZ"[axis], kMmPerM * nodes_m.front(),
                                kMmPerM * nodes_m.back(), fits));
  }
}

/// Correlation of the number of a row with the number of its feature: 1 for a pass from hole 1 to
/// the last hole.
double correlation_with_index(const PassTouches& touches) {
  const auto count = static_cast<double>(touches.size());
  double mean_row = 0.0, mean_index = 0.0;
  for (std::size_t row = 0; row < touches.size(); ++row) {
    mean_row += static_cast<double>(row) / count;
    mean_index += static_cast<double>(touches[row].target.index) / count;
  }

  double product = 0.0, rows = 0.0, indices = 0.0;
  for (std::size_t row = 0; row < touches.size(); ++row) {
    const double r = static_cast<double>(row) - mean_row;
    const double i = static_cast<double>(touches[row].target.index) - mean_index;
    product += r * i;
    rows += r * r;
    indices += i * i;
  }
  return rows > 0.0 && indices > 0.0 ? product / std::sqrt(rows * indices) : 0.0;
}

/// The rows that run against the direction of their pass. The order of the rows is the order of the
/// touches in time, from which the drift is estimated.
std::vector<std::string> rows_against_pass(const std::string& file, const NumberTable& table,
                                           const std::vector<PassTouches>& passes,
                                           const std::vector<Measurement>& measurements) {
  constexpr double kClearlyAgainst = -0.1;
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < passes.size(); ++i) {
    const bool forward = measurements[i].direction == PassDirection::Forward;
    const double along = correlation_with_index(passes[i]) * (forward ? 1.0 : -1.0);
    if (along > kClearlyAgainst) continue;

    std::size_t row = 0;
    while (static_cast<std::size_t>(table.at(row, kMeasurement)) != i) ++row;
    lines.push_back(
        fmt::format("{}:{}:1: measurement: the rows of \"{}\" run against its pass = \"{}\": they "
                    "must be in the "
                    "order of probing",
                    file, table.line(row), measurements[i].name, forward ? "forward" : "backward"));
  }
  return lines;
}

}  // namespace

Result<BarPointsFile> read_bar_points_csv(const std::filesystem::path& file, const Bar& bar,
                                          const BarPlanFile& plan,
                                          const calib::MachineNodes& nodes) {
  auto parsed = parse_table(file, {form_of_touches(plan.plan.measurements)});
  ABBE_TRY(parsed);
  check_rows(*parsed, 1, "touches");
  auto& [source, table, faults] = *parsed;
  TouchRows rows(table, bar, plan, faults);
  for (std::size_t row = 0; row < table.rows(); ++row) rows.read(row);
  rows.check_complete();
  check_readings(table, nodes, faults);
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  BarPointsFile out{source, rows.take(), rows.take_lines(), {}};
  out.against_pass = rows_against_pass(file.string(), table, out.passes, plan.plan.measurements);
  return out;
}

}  // namespace abbe::daemon

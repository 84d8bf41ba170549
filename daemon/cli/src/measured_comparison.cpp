#include "measured_comparison.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>

#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"
#include "figures.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

namespace direct = calib::direct;
using nlohmann::json;

bool any_with(const MeasuredComparison& found, direct::Finding finding) {
  return std::ranges::any_of(found.tables,
                             [&](const auto& table) { return table.finding == finding; });
}

bool is_tested(const direct::TableComparison& table) {
  return table.finding == direct::Finding::Agrees || table.finding == direct::Finding::Contradicts;
}

const char* unit_of(const direct::TableComparison& table) {
  return table.is_angle ? "urad" : "um";
}

// Output as JSON.

json reversal_json(const std::optional<direct::Reversal>& reversal) {
  if (!reversal) return {};
  return {{"mean", kUmPerM * reversal->mean},
          {"u", figure_or_null(kUmPerM, reversal->u)},
          {"largest", kUmPerM * reversal->largest},
          {"largest_at_mm", kMmPerM * reversal->at_m}};
}

json point_json(const direct::TableComparison& table, const direct::PointDifference& point) {
  json object{{"measured", kUmPerM * point.measured},
              {"u_measured", kUmPerM * point.u_measured},
              {"model", kUmPerM * point.model},
              {"u_model", kUmPerM * point.u_model},
              {"difference", kUmPerM * point.difference},
              {"u", kUmPerM * point.u},
              {"limit", point.tested ? json(kUmPerM * point.limit) : json()}};
  if (!table.is_squareness) object["position_mm"] = kMmPerM * point.position_m;
  return object;
}

json table_json(const direct::TableComparison& table) {
  json object{{"name", table.name},
              {"unit", unit_of(table)},
              {"verdict", direct::name(table.finding)},
              {"reason", table.reason},
              {"causes", table.causes},
              {"convention", table.convention},
              {"runs", table.runs},
              {"degrees_of_freedom", table.dof},
              {"positions_left_out", table.left_out},
              {"positions_outside", table.outside},
              {"reversal", reversal_json(table.reversal)},
              {"points", json::array()}};
  for (const auto& point : table.points) object["points"].push_back(point_json(table, point));
  if (table.points.empty()) return object;

  object["mae"] = kUmPerM * table.mae;
  object["rms"] = kUmPerM * table.rms;
  object["max"] = kUmPerM * table.largest;
  object["revealed"] = table.revealed > 0.0 ? json(kUmPerM * table.revealed) : json();
  object["rms_normalised"] = table.rms_normalised;
  object["max_normalised"] = table.largest_normalised;
  return object;
}

json left_out_json(const direct::VolumeComparison& volume) {
  json list = json::array();
  for (const auto& [name, reason] : volume.left_out)
    list.push_back({{"name", name}, {"reason", reason}});
  return list;
}

json volume_json(const calib::Result<direct::VolumeComparison>& volume) {
  if (!volume) return {{"not_compared", volume.error().text}};
  return {{"points", volume->points},
          {"compared", volume->compared},
          {"not_measured", volume->not_measured},
          {"left_out", left_out_json(*volume)},
          {"measured", vector_figures(volume->V_measured)},
          {"model", vector_figures(volume->V_model)},
          {"as_stated", vector_figures(volume->difference.as_stated)},
          {"rigid_free", vector_figures(volume->difference.rigid_free)},
          {"u_rms_um", figure_or_null(kUmPerM, volume->u_rms_m)}};
}

json measured_json(const MeasuredComparison& found, const MeasuredOptions& options) {
  const auto& tool_m = found.tool_m;
  json object{{"measured", found.file.source.name},
              {"sha256", found.file.source.sha256},
              {"straightness", options.straightness},
              {"tool_mm", {kMmPerM * tool_m.x(), kMmPerM * tool_m.y(), kMmPerM * tool_m.z()}},
              {"rows_off", found.rows_off},
              {"tables_tested", std::ranges::count_if(found.tables, is_tested)},
              {"tables", json::array()},
              {"volume", volume_json(found.volume)}};
  for (const auto& table : found.tables) object["tables"].push_back(table_json(table));
  return object;
}

// Output as text.

std::string coloured_verdict(const direct::TableComparison& table) {
  const std::string text = fmt::format("{:<12}", direct::name(table.finding));
  if (table.finding == direct::Finding::Contradicts) return coloured(text, kRed, STDOUT_FILENO);
  if (table.finding == direct::Finding::Agrees) return coloured(text, kGreen, STDOUT_FILENO);
  return text;
}

void print_row(const direct::TableComparison& table) {
  fmt::print("{:<5}  {}  {:>4}  {:>6}", table.name, coloured_verdict(table), table.runs,
             table.points.size());
  if (table.points.empty()) return fmt::print("  {}\n", table.reason);
  const std::string place =
      table.is_squareness ? "-" : fmt::format("{:.1f}", kMmPerM * table.largest_at_m);
  const std::string reversal =
      table.reversal ? fmt::format("{:.2f}", kUmPerM * table.reversal->mean) : "-";
  const std::string revealed =
      table.revealed > 0.0 ? fmt::format("{:.2f}", kUmPerM * table.revealed) : "-";
  fmt::print("  {:>8.2f}  {:>8.2f}  {:>8.2f}  {:>8}  {:<4}  {:>7.2f}  {:>7.2f}  {:>8}  {:>8}\n",
             kUmPerM * table.mae, kUmPerM * table.rms, kUmPerM * table.largest, place,
             unit_of(table), table.rms_normalised, table.largest_normalised, revealed, reversal);
}

void print_remarks(const direct::TableComparison& table) {
  const auto remark = [&](const std::string& text) { fmt::print("{}: {}\n", table.name, text); };
  if (table.left_out > 0)
    remark(fmt::format("{} positions left out: some run or direction does not have them",
                       table.left_out));
  if (table.outside > 0 && !table.points.empty())
    remark(fmt::format("{} positions left out: outside the nodes of the model", table.outside));
  if (!table.reversal && !table.is_squareness)
    remark("one direction of travel only: the values contain half of the backlash");
  if (!table.reason.empty() && !table.points.empty()) remark(table.reason);
  for (const auto& cause : table.causes) remark(cause);
}

/// Prints the conventions, each one once.
void print_conventions(const MeasuredComparison& found) {
  std::vector<std::pair<std::string, std::vector<std::string>>> tables_of;
  for (const auto& table : found.tables) {
    if (table.points.empty()) continue;
    const std::string text = fmt::format(
        "{}{}", table.is_squareness ? "" : fmt::format("{}: ", table.name[2]), table.convention);
    auto at = std::ranges::find(tables_of, text, [](const auto& entry) { return entry.first; });
    if (at == tables_of.end()) at = tables_of.insert(tables_of.end(), {text, {}});
    at->second.push_back(table.name);
  }
  for (const auto& [text, tables] : tables_of)
    fmt::print("{}  ({})\n", text, fmt::join(tables, ", "));
}

void print_volume(const calib::Result<direct::VolumeComparison>& volume) {
  if (!volume) return fmt::print("\nin the volume: {}\n", volume.error().text);
  fmt::print("\n|V| at {} places, from {}, um\n", volume->points,
             fmt::join(volume->compared, ", "));
  if (!volume->not_measured.empty())
    fmt::print("left out of both: {} (not measured)\n", fmt::join(volume->not_measured, ", "));
  for (const auto& [name, reason] : volume->left_out)
    fmt::print("left out of both: {} ({})\n", name, reason);
  constexpr VectorColumns kVolume{.name = 32, .figure = 8};
  fmt::print("{}\n", vector_heading("", kVolume));
  const auto row = [&](const char* what, const calib::VectorStatistics& vectors) {
    fmt::print("{}\n", vector_row(what, vectors, kVolume));
  };
  row("measured", volume->V_measured);
  row("model", volume->V_model);
  row("difference as stated", volume->difference.as_stated);
  row("difference without rigid motion", volume->difference.rigid_free);
  if (volume->u_rms_m)
    fmt::print("{:<32}  {:>8}  {:>8.3f}\n", "standard uncertainty, as stated", "",
               kUmPerM * *volume->u_rms_m);
}

void print_measured_text(const MeasuredComparison& found) {
  fmt::print(
      "measured minus model; |d|/u: relative to the standard uncertainty of both; reveals: a\n"
      "larger difference contradicts at every position\n");
  fmt::print(
      "{:<5}  {:<12}  {:>4}  {:>6}  {:>8}  {:>8}  {:>8}  {:>8}  {:<4}  {:>7}  {:>7}  {:>8}  "
      "{:>8}\n",
      "table", "verdict", "runs", "points", "mae", "rms", "largest", "at mm", "unit", "|d|/u",
      "largest", "reveals", "backlash");
  for (const auto& table : found.tables) print_row(table);
  fmt::print("\n");
  for (const auto& table : found.tables) print_remarks(table);
  for (const auto& line : found.rows_off) fmt::print("{}\n", printable_line(line));
  if (std::ranges::none_of(found.tables, is_tested))
    fmt::print("no table was tested: this comparison neither confirms nor contradicts the model\n");

  print_conventions(found);
  fmt::print(
      "tool offset of the model: ({:.1f}, {:.1f}, {:.1f}) mm; the device must measure the point\n"
      "with this offset: a model of one tool offset is right for this point only, because its\n"
      "translations contain some rotations\n",
      kMmPerM * found.tool_m.x(), kMmPerM * found.tool_m.y(), kMmPerM * found.tool_m.z());
  const bool no_line = std::ranges::all_of(
      found.file.errors, [](const auto& error) { return !error.line_m.has_value(); });
  if (no_line)
    fmt::print(
        "no columns x_mm, y_mm, z_mm: translations are compared as if measured on the axes "
        "of the machine\ncoordinates; 100 mm beside them change a translation by 0.1 um "
        "per urad of rotation\n");
  print_volume(found.volume);
}

/// Adds the options for information that an .rtl file does not contain.
void add_rtl_options(CLI::App& command, MeasuredOptions& options, CLI::Option* measured) {
  command
      .add_option("--measured-error", options.error,
                  "of an .rtl file: EXX, EYY or EZZ, the axis that was measured")
      ->check(CLI::IsMember({"EXX", "EYY", "EZZ"}))
      ->needs(measured);
  command
      .add_option("--measured-line-mm", options.line,
                  "of an .rtl file: X,Y,Z, positions of the axes during the measurement; that of "
                  "the moving\naxis has no effect; the reflector at the tool offset of the model")
      ->needs(measured);
  command
      .add_option("--measured-unit", options.unit,
                  "of an .rtl file: unit of its deviations (targets are in mm)")
      ->check(CLI::IsMember({"um", "mm"}))
      ->needs(measured);
}

}  // namespace

CLI::Option* add_measured_options(CLI::App& command, MeasuredOptions& options) {
  auto* measured = command.add_option(
      "--measured", options.file,
      "measured.csv: error motions that a device measured directly; compare A with them, table by\n"
      "table and in the volume. Exit code 0: at least one table agrees and none contradicts;\n"
      "5: one contradicts; 1: none could be tested, or a single value does not fit the others.\n"
      "`abbe example measured.csv` shows the columns. Or an .rtl file of a Renishaw laser\n"
      "interferometer, with --measured-error, --measured-line-mm and --measured-unit");
  add_rtl_options(command, options, measured);
  command
      .add_option("--straightness", options.straightness,
                  "line that is removed from straightness errors, of both")
      ->check(CLI::IsMember({"end-points", "least-squares"}))
      ->needs(measured)
      ->capture_default_str();
  const auto add_u = [&](const char* name, double& value, const char* text) {
    command.add_option(name, value, text)->check(CLI::NonNegativeNumber)->needs(measured);
  };
  add_u("--u-um", options.u_um, "standard uncertainty of the device: of a translation, each value");
  add_u("--u-urad", options.u_urad, "standard uncertainty of the device: of an angle");
  add_u("--u-ppm", options.u_ppm,
        "standard uncertainty of the device: of lengths (wavelength, expansion)");
  return measured;
}

Result<int> compare_with_measured(const calib::VolumetricModel& model,
                                  const MeasuredOptions& options, bool as_json) {
  const auto found = compare_measured(model, options);
  ABBE_TRY(found);
  if (as_json)
    fmt::print("{}\n", indented_json_text(measured_json(*found, options)));
  else
    print_measured_text(*found);

  if (any_with(*found, direct::Finding::Contradicts)) return exit_code(ErrorCode::Refused);
  const bool tested = any_with(*found, direct::Finding::Agrees);
  return tested && found->rows_off.empty() ? 0 : exit_code(ErrorCode::DataInsufficient);
}

}  // namespace abbe::daemon

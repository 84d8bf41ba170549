// `abbe identify bar`: calibrates a Multi-Feature Bar by reversal on a measuring machine.
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abbe/base/json_text.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/gauge_file.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "commands.hpp"
#include "identify_bar.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct BarOnMachine {
  calib::mfb::BarCalibration calibration;
  std::vector<InputFile> sources;
  std::size_t repeats = 0;
  std::vector<std::string> notes;
};

Result<BarOnMachine> calibrated_bar(const IdentifyBarArguments& arguments) {
  const auto bar = read_bar_toml(arguments.bar);
  ABBE_TRY(bar);
  const auto plan = read_bar_plan_toml(arguments.plan, bar->bar);
  ABBE_TRY(plan);
  const auto points =
      read_bar_points_csv(arguments.points, bar->bar, *plan, nodes_of_measuring_machine());
  ABBE_TRY(points);
  const auto gauge = read_gauge_toml(arguments.gauge);
  ABBE_TRY(gauge);

  auto found = calib::mfb::calibrate_bar(bar->bar, plan->plan, points->passes, gauge->gauge);
  if (!found) return tl::make_unexpected(error_of(found.error()));
  BarOnMachine out{std::move(*found),
                   {bar->source, plan->source, points->source, gauge->source},
                   plan->plan.measurements.size() / 2,
                   {}};
  out.notes = out.calibration.notes;
  return out;
}

/// The comment at the head of the file: origin of the data, meaning of the uncertainty.
std::string head_of(const BarOnMachine& found) {
  const auto& c = found.calibration;
  std::string text = fmt::format(
      "# Calibrated by reversal: {} normal and {} reversed passes. Covariance: k = 1, with the "
      "mean "
      "of the\n# repeats ({} degrees of freedom) widened by Student's t, {:.3f} / 1.96.\n",
      found.repeats, found.repeats, c.degrees_of_freedom, c.student_t95);
  for (const InputFile& source : found.sources)
    text += fmt::format("# from {}, SHA-256 {}\n", source.name, source.sha256);
  for (const std::string& note : found.notes) text += fmt::format("# {}\n", note);
  return text;
}

nlohmann::json vector_um(const calib::Vector3& v_m) {
  return {kUmPerM * v_m.x(), kUmPerM * v_m.y(), kUmPerM * v_m.z()};
}

nlohmann::json bar_json(const BarOnMachine& found, const std::string& out) {
  const auto& c = found.calibration;
  nlohmann::json points = nlohmann::json::array();
  for (std::size_t i = 0; i < c.bar.O_m.size(); ++i) {
    const calib::Vector3& O_m = c.bar.O_m[i];
    const auto& x = c.positioning[i];
    points.push_back({{"hole", i + 1},
                      {"place_mm", {kMmPerM * O_m.x(), kMmPerM * O_m.y(), kMmPerM * O_m.z()}},
                      {"u_um", vector_um(c.u_m[i])},
                      {"u_repeats_um", vector_um(c.u_repeats_m[i])},
                      {"U95_repeats_um", vector_um(c.student_t95 * c.u_repeats_m[i])},
                      {"u_x_um",
                       {{"repeats", kUmPerM * x.repeats_m},
                        {"gauge", kUmPerM * x.gauge_m},
                        {"abbe", kUmPerM * x.abbe_m},
                        {"temperature", kUmPerM * x.temperature_m}}},
                      {"machine_um", vector_um(c.machine_m[i])}});
  }
  return {{"bar", c.bar.name},
          {"repeats", found.repeats},
          {"degrees_of_freedom", c.degrees_of_freedom},
          {"student_t95", c.student_t95},
          {"direction", {c.direction.x(), c.direction.y(), c.direction.z()}},
          {"gauge_beside_bar_mm", {kMmPerM * c.gauge_beside_m.y(), kMmPerM * c.gauge_beside_m.z()}},
          {"points", points},
          {"notes", found.notes},
          {"written", out}};
}

void print_summary(const BarOnMachine& found, const std::string& out) {
  const auto& c = found.calibration;
  fmt::print("{}: {} repeats, Student's t (95 %, {} degrees of freedom) {:.3f}\n", c.bar.name,
             found.repeats, c.degrees_of_freedom, c.student_t95);
  fmt::print("{:>4} {:>12} {:>10} {:>10}  {:>23}  {:>17}\n", "", "", "", "", "u (k = 1)",
             "t u of the mean");
  fmt::print("{:>4} {:>12} {:>10} {:>10}  {:>7} {:>7} {:>7}  {:>8} {:>8}\n", "hole", "x_mm", "y_mm",
             "z_mm", "x_um", "y_um", "z_um", "y_um", "z_um");
  for (std::size_t i = 0; i < c.bar.O_m.size(); ++i) {
    const calib::Vector3 mm = kMmPerM * c.bar.O_m[i], u_um = kUmPerM * c.u_m[i];
    const calib::Vector3 U95_um = kUmPerM * c.student_t95 * c.u_repeats_m[i];
    fmt::print(
        "{:>4} {:>12.5f} {:>10.5f} {:>10.5f}  {:>7.3f} {:>7.3f} {:>7.3f}  {:>8.3f} {:>8.3f}\n",
        i + 1, mm.x(), mm.y(), mm.z(), u_um.x(), u_um.y(), u_um.z(), U95_um.y(), U95_um.z());
  }

  const auto& x = c.positioning.back();
  fmt::print(
      "u(x) of the last hole: repeats {:.3f}, step gauge {:.3f}, Abbe offset {:.3f}, "
      "temperature of the bar {:.3f} um\n",
      kUmPerM * x.repeats_m, kUmPerM * x.gauge_m, kUmPerM * x.abbe_m, kUmPerM * x.temperature_m);
  for (const std::string& note : found.notes) fmt::print("note: {}\n", note);
  fmt::print("written {}\n", out);
}

}  // namespace

calib::MachineNodes nodes_of_measuring_machine() {
  constexpr double kFar_m = 50.0;
  calib::MachineNodes nodes;
  for (auto& axis : nodes) axis.nodes_m = {-kFar_m, kFar_m};
  return nodes;
}

int identify_bar(const IdentifyBarArguments& arguments) {
  const auto found = calibrated_bar(arguments);
  if (!found) return report(found.error());
  if (const auto written =
          replace_file(arguments.out, bar_toml(found->calibration.bar, head_of(*found)));
      !written)
    return report(written.error());
  if (arguments.json)
    fmt::print("{}\n", indented_json_text(bar_json(*found, arguments.out)));
  else
    print_summary(*found, arguments.out);
  return 0;
}

void add_identify_bar(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<IdentifyBarArguments>();
  auto* command = parent.add_subcommand(
      "bar",
      "Calibrate a Multi-Feature Bar by reversal on a measuring machine: passes with the bar as "
      "it\n"
      "lies and turned by 180 degrees about its x axis, and a step gauge on its line. Writes\n"
      "bar.toml for `abbe identify mfb`");
  command
      ->add_option("--bar", arguments->bar,
                   "bar.toml with the nominal points, or those of an earlier calibration")
      ->required();
  command
      ->add_option(
          "--plan", arguments->plan,
          "plan.toml: one [[measurement]] and position per pass; bar_z of a reversed pass is\n"
          "opposite to that of the first")
      ->required();
  command
      ->add_option(
          "--points", arguments->points,
          "touches: measurement,feature,index,side,k,x_mm,y_mm,z_mm; scale readings, index\n"
          "and side as on the bar")
      ->required();
  command->add_option("--gauge", arguments->gauge, "gauge.toml: the step gauge and its readings")
      ->required();
  command->add_flag("--json", arguments->json, "print the summary as one JSON object");
  command->add_option("-o,--out", arguments->out, "file to write: bar.toml")->required();
  command->callback([arguments, &exit] { exit = identify_bar(*arguments); });
}

}  // namespace abbe::daemon

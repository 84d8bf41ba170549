// `abbe identify bar`: calibrates a Multi-Feature Bar by reversal on a measuring machine.
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "abbe/base/json_text.hpp"
#include "abbe/base/units.hpp"
#include "commands.hpp"
#include "identify_bar.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

nlohmann::json vector_um(const calib::Vector3& v_m) {
  return {kUmPerM * v_m.x(), kUmPerM * v_m.y(), kUmPerM * v_m.z()};
}

nlohmann::json bar_json(const IdentifiedBar& found, const std::string& out) {
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
          {"notes", c.notes},
          {"written", out}};
}

void print_summary(const IdentifiedBar& found, const std::string& out) {
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
  for (const std::string& note : c.notes) fmt::print("note: {}\n", note);
  fmt::print("written {}\n", out);
}

}  // namespace

int run_identify_bar(const IdentifyBarCommand& arguments) {
  const auto found = identify_bar(arguments);
  if (!found) return report(found.error());
  if (arguments.json)
    fmt::print("{}\n", indented_json_text(bar_json(*found, arguments.out)));
  else
    print_summary(*found, arguments.out);
  return 0;
}

void add_identify_bar(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<IdentifyBarCommand>();
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
  command->callback([arguments, &exit] { exit = run_identify_bar(*arguments); });
}

}  // namespace abbe::daemon

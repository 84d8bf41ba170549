/// abbe-sim truth: prints V of the simulated machine at points, for a comparison with an identified
/// model. abbe-sim machine: prints its 21 errors as a table.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <iterator>
#include <memory>

#include "abbe/result/try.hpp"
#include "abbe/sim/truth_table.hpp"
#include "commands.hpp"
#include "files.hpp"
#include "setup_file.hpp"

namespace abbe::sim {
namespace {

struct TruthOptions {
  SetupChoices choices;
  std::string points_file;
  std::vector<std::size_t> grid;
  std::vector<double> tool_mm;  // empty: the target offset of the machine file
  std::string out = "-";
};

std::vector<Eigen::Vector3d> grid_points(const TruthMachine& truth,
                                         const std::vector<std::size_t>& n) {
  const auto at = [&](std::size_t axis, std::size_t i) {
    const AxisRange& r = truth.axes[axis].range;
    return n[axis] == 1 ? 0.5 * (r.min_m + r.max_m)
                        : r.min_m + (r.max_m - r.min_m) * static_cast<double>(i) /
                                        static_cast<double>(n[axis] - 1);
  };

  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < n[0]; ++i) {
    for (std::size_t j = 0; j < n[1]; ++j) {
      for (std::size_t k = 0; k < n[2]; ++k) points.emplace_back(at(0, i), at(1, j), at(2, k));
    }
  }

  return points;
}

Result<std::vector<Eigen::Vector3d>> file_points(const std::string& file) {
  const auto text = read_file(file);
  ABBE_TRY(text);
  const auto rows = parse_path_csv(*text, file);  // path.csv has the same columns
  ABBE_TRY(rows);
  std::vector<Eigen::Vector3d> points;
  for (const PathVertex& row : *rows) points.push_back(row.q_m);
  return points;
}

std::string as_csv(const TruthMachine& truth, const std::vector<Eigen::Vector3d>& points) {
  std::string out = "x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
  for (const Eigen::Vector3d& q : points) {
    const Eigen::Vector3d q_mm = 1e3 * q;
    const Eigen::Vector3d v_um = 1e6 * error_m(truth, q);
    fmt::format_to(std::back_inserter(out), "{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n",
                   q_mm.x(), q_mm.y(), q_mm.z(), v_um.x(), v_um.y(), v_um.z());
  }
  return out;
}

int write_or_report(const std::string& path, const std::string& text) {
  const auto written = write_file(path, text);
  return written ? kDone : report(written.error());
}

int truth_at_points(const TruthOptions& options) {
  const auto setup = load_setup(options.choices);
  if (!setup) return report(setup.error());
  TruthMachine truth = setup->simulation.truth;
  if (!options.tool_mm.empty())
    truth.target_offset_m = 1e-3 * Eigen::Vector3d(options.tool_mm.data());
  if (options.points_file.empty())
    return write_or_report(options.out, as_csv(truth, grid_points(truth, options.grid)));
  const auto points = file_points(options.points_file);
  return points ? write_or_report(options.out, as_csv(truth, *points)) : report(points.error());
}

int truth_tables(const TruthOptions& options) {
  const auto setup = load_setup(options.choices);
  if (!setup) return report(setup.error());
  return write_or_report(options.out, format_truth_csv(setup->simulation.truth));
}

std::shared_ptr<TruthOptions> add_common(CLI::App& sub) {
  auto options = std::make_shared<TruthOptions>();  // lives as long as the command line's callbacks
  options->choices.needs_path = false;
  add_machine_options(sub, options->choices);
  sub.add_option("-o,--out", options->out, "default: standard output")->type_name("FILE");
  return options;
}

}  // namespace

Subcommand add_truth(CLI::App& app) {
  CLI::App* sub = app.add_subcommand(
      "truth", "V = actual - nominal of the cold machine without backlash, as CSV");
  auto options = add_common(*sub);
  options->grid = {13, 11, 9};
  CLI::Option* points =
      sub->add_option("--points", options->points_file, "CSV x_mm,y_mm,z_mm of scale readings")
          ->type_name("FILE");
  sub->add_option("--grid", options->grid,
                  "points along X, Y, Z over the whole travel, ends included (default 13 11 9)")
      ->expected(3)
      ->check(CLI::Range(1, 1000))
      ->excludes(points);
  sub->add_option("--tool-mm", options->tool_mm,
                  "x,y,z: tool offset in mm (default: [target] offset_mm of the machine)")
      ->delimiter(',')
      ->expected(3);

  return {sub, [options] { return truth_at_points(*options); }};
}

Subcommand add_machine(CLI::App& app) {
  CLI::App* sub = app.add_subcommand("machine", "the 21 errors of the machine as CSV, for --truth");
  auto options = add_common(*sub);
  return {sub, [options] { return truth_tables(*options); }};
}

}  // namespace abbe::sim

/// `abbe plan otf`: computes a path for an on-the-fly calibration, or predicts the uncertainty of
/// an existing path.

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/Validators.hpp>
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/methods/otf/path_plan.hpp"
#include "abbe/methods/otf/path_program.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/plan_otf.hpp"
#include "commands.hpp"
#include "interruption.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

namespace otf = calib::otf;

struct PlanOtfCommand : PlanOtfArguments {
  std::string out;
  std::vector<std::string> dialects;
  bool json = false;
};

std::vector<double> in_mm(const calib::Vector3& p_m) {
  return {p_m[0] * kMmPerM, p_m[1] * kMmPerM, p_m[2] * kMmPerM};
}

nlohmann::json plan_json(const PathPlan& plan, const PlanOtfCommand& arguments) {
  nlohmann::json trackers = nlohmann::json::array();
  for (const auto& [tracker_m, rms_u_m] : plan.trackers)
    trackers.push_back({{"position_mm", in_mm(tracker_m)}, {"rms_u_um", rms_u_m * kUmPerM}});
  return {{"legs", plan.path.vertices_m.size() - 1},
          {"feed_mm_per_min", arguments.feed_mm_per_min},
          {"points_per_s", plan.run.points_per_s},
          {"tracker_mm", in_mm(plan.run.tracker_m)},
          {"corners_not_reached", plan.corners_not_reached},
          {"ended_early", plan.ended_early},
          {"prediction", prediction_json(plan.prediction)},
          {"base_path", plan.base ? prediction_json(*plan.base) : nlohmann::json{}},
          {"trackers_compared", trackers}};
}

/// Standstill before and after the run: twice what the session needs.
double stand_s(const otf::PlannedRun& run) {
  constexpr double kLeast_s = 2.0, kPoints = 120.0;
  return std::max(kLeast_s, kPoints / run.points_per_s);
}

Result<std::vector<std::string>> write_plan(const PathPlan& plan, const PlanOtfCommand& arguments) {
  const std::filesystem::path folder = arguments.out;
  ABBE_TRY(create_folder(folder, NewFolder::OfTheCaller));
  std::vector<std::pair<std::string, std::string>> files{
      {"path.csv", to_path_csv(plan.path, plan.run.drive.feed_m_per_s)},
      {"map.csv", to_map_csv(plan.prediction)},
      {"plan.json", indented_json_text(plan_json(plan, arguments)) + "\n"}};
  for (const auto& named : arguments.dialects) {
    if (const auto dialect = dialect_named(named))
      files.emplace_back(fmt::format("path{}", extension(*dialect)),
                         path_program(plan.path, plan.run.drive, stand_s(plan.run), *dialect));
  }

  std::vector<std::string> written;
  for (const auto& [name, text] : files) {
    ABBE_TRY(replace_file(folder / name, text));
    written.push_back(name);
  }
  return written;
}

void print_prediction(const char* what, const otf::Prediction& p) {
  fmt::print("{:<11} {:.4f} um rms, {:.4f} um largest; {:.2f} m, {:.1f} min, condition {:.3g}\n",
             what, p.rms_u_m * kUmPerM, p.max_u_m * kUmPerM, p.length_m, p.duration_s / kMinute_s,
             p.condition);
}

void print_uncertainty(const std::string& name, const otf::TableUncertainty& table) {
  const bool angle = table.name[1] >= 'A' && table.name[1] <= 'C';
  fmt::print("{:<11} u {:.4g} {} rms, {:.4g} largest\n", name, table.rms_u * kUmPerM,
             angle ? "urad" : "um", table.max_u * kUmPerM);
}

void print_plan(const PathPlan& plan, const std::vector<std::string>& written,
                const std::string& folder) {
  for (const auto& [tracker_m, rms_u_m] : plan.trackers) {
    fmt::print("tracker     at {:.6g}, {:.6g}, {:.6g} mm: {:.4f} um rms with a quick path{}\n",
               tracker_m[0] * kMmPerM, tracker_m[1] * kMmPerM, tracker_m[2] * kMmPerM,
               rms_u_m * kUmPerM, tracker_m == plan.run.tracker_m ? " (chosen)" : "");
  }
  const double u_offset_um = plan.run.noise.u_range_offset_m * kUmPerM;
  fmt::print("standard uncertainty of V without the rigid motion, from white noise {}:\n",
             u_offset_um > 0.0
                 ? fmt::format("and an offset of the ranges of {:.4g} um", u_offset_um)
                 : "alone");
  print_prediction("path", plan.prediction);
  if (plan.base)
    print_prediction("base path", *plan.base);
  else
    fmt::print("base path   {}\n", plan.base.error().text);

  fmt::print("rank        {} of {} unknowns, {} fixed by the datum\n", plan.prediction.rank,
             plan.prediction.unknowns, plan.prediction.datum_defect);
  fmt::print("no table    {} (one target does not show them)\n",
             fmt::join(plan.prediction.left_out, ", "));
  for (const auto& table : plan.prediction.tables) print_uncertainty(table.name, table);
  for (const auto& table : plan.prediction.backlash)
    print_uncertainty(table.name + ".backlash", table);
  if (!plan.prediction.unused.empty()) fmt::print("note        {}\n", plan.prediction.unused);
  if (plan.ended_early) fmt::print("note        Ctrl-C: this is the path found so far\n");
  if (plan.corners_not_reached > 0)
    fmt::print(
        "note        {} corners of the travel are not reached: the model is not valid "
        "there\n",
        plan.corners_not_reached);
  if (!written.empty()) fmt::print("written     {} in {}\n", fmt::join(written, ", "), folder);
}

int run(const PlanOtfCommand& arguments) {
  ProgressBar bar(!arguments.json);
  if (arguments.path.empty()) mark_interruptions({SIGINT});
  const auto plan = plan_otf(arguments, bar.progress(interrupted));
  bar.clear();
  if (!plan && interrupted()) {
    fmt::print(stderr, "abbe: interrupted before the first path was found\n");
    return number(ExitCode::Interrupted);
  }
  if (!plan) return report(plan.error());
  std::vector<std::string> written;
  if (!arguments.out.empty()) {
    auto files = write_plan(*plan, arguments);
    if (!files) return report(files.error());
    written = *std::move(files);
  }
  if (arguments.json)
    fmt::print("{}\n", indented_json_text(plan_json(*plan, arguments)));
  else
    print_plan(*plan, written, arguments.out);
  return 0;
}

void add_machine_options(CLI::App& command, PlanOtfCommand& arguments) {
  auto* machine = command.add_option("--machine,-c", arguments.machine,
                                     "machine.toml or the daemon's abbed.toml");
  auto* travel = command
                     .add_option("--travel-mm", arguments.travel_mm,
                                 "instead of --machine, the travel: XMIN,XMAX,YMIN,YMAX,ZMIN,ZMAX")
                     ->delimiter(',')
                     ->expected(6);
  auto* chain = command.add_option("--chain", arguments.chain, "with --travel-mm: kinematic chain")
                    ->capture_default_str();
  auto* tool = command
                   .add_option("--tool-mm", arguments.tool,
                               "with --travel-mm: x,y,z, centre of the reflector relative to "
                               "the tool reference point, mm")
                   ->capture_default_str();
  auto* nodes = command
                    .add_option("--node-spacing-mm", arguments.node_spacing_mm,
                                "with --travel-mm: distance of the nodes of the tables")
                    ->check(CLI::PositiveNumber)
                    ->capture_default_str();
  machine->excludes(travel);
  for (auto* option : {chain, tool, nodes}) option->needs(travel);
}

void add_drive_options(CLI::App& command, PlanOtfCommand& arguments) {
  command.add_option("--feed-mm-per-min", arguments.feed_mm_per_min, "feed on each leg, mm/min")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command
      .add_option("--acceleration-m-per-s2", arguments.drive.acceleration_m_per_s2,
                  "of the machine along a leg")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command.add_option("--dwell-s", arguments.drive.dwell_s, "standstill before each leg")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      .add_option("--points-per-s", arguments.points_per_s,
                  "of the tracker; default: that of the configured tracker, or 500")
      ->check(CLI::PositiveNumber);
}

}  // namespace

void add_plan_otf(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<PlanOtfCommand>();
  auto* command = parent.add_subcommand(
      "otf",
      "Plan the path of an on-the-fly calibration: the path with the smallest predicted "
      "uncertainty\n"
      "for its length, beside the usual path of edges and diagonals. Writes path.csv, map.csv,\n"
      "plan.json and programs for the control to OUT. White noise is predicted, and an offset of\n"
      "the ranges ([tracker] u_range_offset_um); turbulence adds to it. The first path is there\n"
      "after seconds and becomes better by a few per cent; Ctrl-C: use the one found so far.");
  add_machine_options(*command, *arguments);
  command
      ->add_option(
          "--tracker-at-mm", arguments->trackers,
          "x,y,z: centre of the tracker, machine coordinates, mm; several times: they are\n"
          "compared, and the best one is used; default: [tracker] position_mm")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  auto* length = command
                     ->add_option("--length-m", arguments->length_m,
                                  "longest path, m; default: the length of the base path")
                     ->check(CLI::PositiveNumber);
  auto* budget = command->add_option("--budget-min", arguments->budget_min, "longest duration, min")
                     ->check(CLI::PositiveNumber);
  add_drive_options(*command, *arguments);
  command
      ->add_option("--lattice", arguments->lattice,
                   "turning points for each axis of the first walk")
      ->check(CLI::Range(3, 7))
      ->capture_default_str();
  command
      ->add_option("--exchanges", arguments->exchanges,
                   "attempts to improve the first walk, about 2 ms each; 0: the walk alone")
      ->check(CLI::Range(0, 1'000'000))
      ->capture_default_str();
  auto* path = command->add_option("--path", arguments->path,
                                   "path.csv: predict this path instead of planning one");
  path->excludes(length)->excludes(budget);
  std::vector<std::string> names;
  for (const Dialect dialect : kDialects) names.emplace_back(name(dialect));
  command
      ->add_option("--dialect", arguments->dialects,
                   "also write a program for this control: path.ngc, path.mpf, path.h")
      ->check(CLI::IsMember(names))
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_flag("--json", arguments->json, "print the figures as one JSON object");
  command->add_option("-o,--out", arguments->out, "folder for the results; created if needed");

  command->callback([arguments, &exit] { exit = run(*arguments); });
}

}  // namespace abbe::daemon

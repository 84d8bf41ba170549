#include "abbe/tasks/plan_otf.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "abbe/base/units.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe/tasks/vector_option.hpp"

namespace abbe::daemon {

namespace otf = calib::otf;

namespace {

/// The configuration that corresponds to the options, without tracker and devices.
Result<Config> machine_of_options(const PlanOtfArguments& arguments) {
  const auto tool_m = parse_mm("--tool-mm", arguments.tool);
  ABBE_TRY(tool_m);
  std::string text =
      fmt::format("[machine]\nname = \"command line\"\nchain = \"{}\"\n", arguments.chain);
  for (std::size_t k = 0; k < 3; ++k) {
    text += fmt::format("[axes.{}]\nmin_mm = {:.17g}\nmax_mm = {:.17g}\n", "XYZ"[k],
                        arguments.travel_mm[2 * k], arguments.travel_mm[2 * k + 1]);
  }
  text += fmt::format("[target]\noffset_mm = [{:.17g}, {:.17g}, {:.17g}]\n", (*tool_m)[0] * kMmPerM,
                      (*tool_m)[1] * kMmPerM, (*tool_m)[2] * kMmPerM);
  text += fmt::format("[model]\nnode_spacing_mm = {:.17g}\n", arguments.node_spacing_mm);
  return parse_config(text, "options");
}

Result<std::vector<calib::Vector3>> trackers_of(const PlanOtfArguments& arguments,
                                                const MachineConfig& machine) {
  std::vector<calib::Vector3> trackers;
  for (const auto& text : arguments.trackers) {
    const auto at = parse_mm("--tracker-at-mm", text);
    ABBE_TRY(at);
    trackers.push_back(*at);
  }
  if (trackers.empty() && machine.tracker_position_m)
    trackers.emplace_back(machine.tracker_position_m->data());
  if (trackers.empty())
    return fail(
        ErrorCode::Usage,
        fmt::format("plan otf: the position of the tracker is unknown: --tracker-at-mm x,y,z in "
                    "machine coordinates, or {} position_mm in the configuration",
                    tables_with(Capability::TrackerPoints)));
  return trackers;
}

Result<otf::PlannedRun> run_of(const PlanOtfArguments& arguments, const Config& config) {
  ABBE_TRY(require_target(config.machine));
  const auto machine = otf_machine(config.machine);
  ABBE_TRY(machine);
  otf::PlannedRun run{.machine = *machine, .noise = otf_noise(config.machine)};
  run.backlash = calib_of(config.otf.backlash);
  run.drive = arguments.drive;
  run.drive.feed_m_per_s = arguments.feed_mm_per_min / kMmPerM / kMinute_s;
  if (const auto tracker = tracker_source(config); tracker)
    run.points_per_s = tracker->point_rate_hz;
  if (arguments.points_per_s) run.points_per_s = *arguments.points_per_s;
  return run;
}

otf::PathBudget budget_of(const PlanOtfArguments& arguments, const otf::Machine& machine) {
  otf::PathBudget budget;
  if (arguments.length_m) budget.length_m = *arguments.length_m;
  if (arguments.budget_min) budget.duration_s = *arguments.budget_min * kMinute_s;
  if (!arguments.length_m && !arguments.budget_min)
    budget.length_m = otf::lengths_to_vertices_m(otf::base_path(machine.nodes)).back();
  return budget;
}

/// Compares the tracker positions with quickly computed paths, and sets the best position in `run`.
Result<std::vector<std::pair<calib::Vector3, double>>> compare_trackers(
    otf::PlannedRun& run, const std::vector<calib::Vector3>& trackers,
    const otf::PathBudget& budget, const otf::Stopped& stopped) {
  std::vector<std::pair<calib::Vector3, double>> compared;
  for (const auto& tracker_m : trackers) {
    run.tracker_m = tracker_m;
    const auto quick = otf::plan(run, budget, {.lattice = 3, .exchanges = 0, .stopped = stopped});
    if (!quick) return tl::make_unexpected(error_of(quick.error()));
    compared.emplace_back(tracker_m, quick->rms_u_m);
  }
  run.tracker_m = std::min_element(compared.begin(), compared.end(), [](auto& a, auto& b) {
                    return a.second < b.second;
                  })->first;
  return compared;
}

Result<otf::Path> path_of_file(const std::string& file) {
  const auto path = read_path_csv(file);
  ABBE_TRY(path);
  return otf_path(path->vertices_m);
}

}  // namespace

Result<PathPlan> plan_otf(const PlanOtfArguments& arguments, const Progress& progress) {
  constexpr std::size_t kTravelNumbers = 6;  // lower and upper end of X, Y and Z
  if (arguments.machine.empty() && arguments.travel_mm.size() != kTravelNumbers)
    return fail(ErrorCode::Usage, "plan otf needs --machine or --travel-mm");
  const auto config =
      arguments.machine.empty() ? machine_of_options(arguments) : load_config(arguments.machine);
  ABBE_TRY(config);
  const auto trackers = trackers_of(arguments, config->machine);
  ABBE_TRY(trackers);
  auto run = run_of(arguments, *config);
  ABBE_TRY(run);

  const otf::PathBudget budget = budget_of(arguments, run->machine);
  const auto stopped = [&progress] { return progress.stopped(); };
  PathPlan plan{.run = *run};
  plan.run.tracker_m = trackers->front();
  if (!arguments.path.empty()) {
    auto path = path_of_file(arguments.path);
    ABBE_TRY(path);
    plan.path = *std::move(path);
  } else {
    if (trackers->size() > 1) {
      auto compared = compare_trackers(plan.run, *trackers, budget, stopped);
      ABBE_TRY(compared);
      plan.trackers = *std::move(compared);
    }
    progress.show("first path", 0.0);
    const auto best = otf::plan(
        plan.run, budget,
        {.lattice = arguments.lattice,
         .exchanges = arguments.exchanges,
         .stopped = stopped,  // used until there is a path
         .enough = stopped,
         .progress = [&progress](double share, double rms_u_m) {
           progress.show(fmt::format("{:.4f} um (Ctrl-C: use it)", rms_u_m * kUmPerM), share);
         }});
    if (!best) return tl::make_unexpected(error_of(best.error()));
    plan.path = best->path;
    plan.corners_not_reached = best->corners_not_reached;
    plan.ended_early = best->ended_early;
  }

  const auto prediction = otf::predict(plan.path, plan.run);
  if (!prediction) return tl::make_unexpected(error_of(prediction.error()));
  plan.prediction = *prediction;
  plan.base = otf::predict(otf::base_path(plan.run.machine.nodes), plan.run);
  return plan;
}

}  // namespace abbe::daemon

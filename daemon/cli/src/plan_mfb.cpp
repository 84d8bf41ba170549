/// `abbe plan mfb`: plans the positions and measurements of a calibration with a Multi-Feature Bar,
/// or judges an existing plan.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/Validators.hpp>
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abbe/base/json_text.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/methods/mfb/bar_plan.hpp"
#include "abbe/tasks/plan_mfb.hpp"
#include "commands.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct PlanMfbCommand : PlanMfbArguments {
  std::string out;
  bool json = false;
};

namespace mfb = calib::mfb;

void print_errors(const mfb::PlanPrediction& p) {
  for (const auto& e : p.errors) {
    const double scale = e.is_angle ? kUradPerRad : kUmPerM;
    const bool seen = std::find(p.not_seen.begin(), p.not_seen.end(), e.name) == p.not_seen.end();
    fmt::print("{:<12}u {:.3g} {} rms, {:.3g} largest{}\n", e.name, e.rms_u * scale,
               e.is_angle ? "urad" : "um", e.max_u * scale, seen ? "" : "  NOT SEEN");
  }
}

void print_bar_plan(const BarPlan& plan, const mfb::Bar& bar) {
  const std::size_t passes = plan.plan.measurements.size();
  fmt::print("set         {}: {} measurements in {} positions, {} clampings\n", plan.set,
             plan.measurements(), plan.positions(), plan.clampings());
  fmt::print("duration    {:.0f} min: {} passes of {} touches, without clamping\n",
             plan.duration_s / kSecondsPerMinute, passes, bar.pattern.count());
  fmt::print("readings    ");
  for (int k = 0; k < 3; ++k)
    fmt::print("{}{} {:.1f} to {:.1f} mm", k == 0 ? "" : ", ", "XYZ"[k],
               plan.readings.min_m[k] * kMmPerM, plan.readings.max_m[k] * kMmPerM);
  fmt::print("\nrank        {} of {} unknowns, {} observations, condition {:.3g}\n",
             plan.prediction.rank, plan.prediction.unknowns, plan.prediction.observations,
             plan.prediction.condition);
  fmt::print("predicted standard uncertainty (k = 1) of the 21 errors:\n");
  print_errors(plan.prediction);
  if (plan.start)
    fmt::print("exchange    worst u / limit {:.3g}, before positions were exchanged {:.3g}\n",
               plan.prediction.worst, plan.start->worst);
  for (const auto& missing : plan.missing) fmt::print("missing     {}\n", missing);
  for (const auto& note : plan.notes) fmt::print("note        {}\n", note);
}

/// The smallest distance of two neighbours.
double least_step_m(const std::vector<double>& places_m) {
  double least_m = places_m.back() - places_m.front();
  for (std::size_t i = 1; i < places_m.size(); ++i)
    least_m = std::min(least_m, places_m[i] - places_m[i - 1]);
  return least_m;
}

/// Reasons why the plan does not determine the errors of one axis at all of its nodes.
std::vector<std::string> reasons_of_axis(const BarPlan& plan, const PlanInputs& inputs,
                                         calib::Axis axis) {
  constexpr double kCloser = 0.9;  // fraction of the distance of the holes
  const auto& nodes_m = inputs.machine.nodes[index(axis)].nodes_m;
  const double pitch_m = least_step_m(inputs.bar.pattern.hole_x_m);
  const double step_m = least_step_m(nodes_m);
  std::vector<std::string> reasons;
  if (step_m < kCloser * pitch_m)
    reasons.push_back(
        fmt::format("nodes of {} are {:.4g} mm apart, the holes of the bar {:.4g} mm: use [model] "
                    "node_spacing_mm = {:.4g}",
                    letter(axis), step_m * kMmPerM, pitch_m * kMmPerM, pitch_m * kMmPerM));

  const double from_m = plan.readings.min_m[static_cast<Eigen::Index>(index(axis))];
  const double to_m = plan.readings.max_m[static_cast<Eigen::Index>(index(axis))];
  if (from_m > nodes_m[1] || to_m < nodes_m[nodes_m.size() - 2])
    reasons.push_back(fmt::format(
        "{}: the touches are from {:.1f} to {:.1f} mm, [axes.{}] is {:.1f} to {:.1f} mm: plan for "
        "this machine, or identify this range only",
        letter(axis), from_m * kMmPerM, to_m * kMmPerM, letter(axis), nodes_m.front() * kMmPerM,
        nodes_m.back() * kMmPerM));
  return reasons;
}

/// The Error for a plan that does not determine all errors.
Error not_seen(const BarPlan& plan, const PlanInputs& inputs) {
  const mfb::SolveOptions limits;
  Error error{ErrorCode::DataInsufficient,
              fmt::format("plan mfb: {} cannot show {}: predicted uncertainty above {:.3g} um or "
                          "{:.3g} urad",
                          plan.set, fmt::join(plan.prediction.not_seen, ", "),
                          limits.most_u_m * kUmPerM, limits.most_u_rad * kUradPerRad),
              plan.missing};
  if (!plan.missing.empty())
    error.details.emplace_back(
        "the stem of a stylus is along the ram, the last axis of the chain, or across it if the "
        "tip is beside it; state another one: --stylus-mm=x,y,z,-x");
  for (const auto axis : calib::kAllAxes)
    for (auto& reason : reasons_of_axis(plan, inputs, axis))
      error.details.push_back(std::move(reason));
  error.details.emplace_back(
      "angles of an axis need bars at two places across it, or, next to the tool, two styli at one "
      "position; squareness needs bars along the diagonals");
  return error;
}

int run(const PlanMfbCommand& arguments) {
  const auto inputs = bar_plan_inputs(arguments);
  if (!inputs) return report(inputs.error());
  ProgressBar bar(!arguments.json);
  const auto plan = arguments.check.empty() ? plan_mfb(arguments, *inputs, bar.progress())
                                            : judged_bar_plan(arguments, *inputs);
  bar.clear();
  if (!plan) return report(plan.error());

  const bool complete = plan->prediction.not_seen.empty();
  if (arguments.json)
    fmt::print("{}\n", indented_json_text(bar_plan_json(*plan, inputs->bar)));
  else
    print_bar_plan(*plan, inputs->bar);
  if (!complete) return report(not_seen(*plan, *inputs));
  if (!arguments.out.empty()) {
    const auto text = to_plan_toml(*plan, inputs->bar, inputs->machine_name);
    if (auto done = replace_file(arguments.out, text); !done) return report(done.error());
    if (!arguments.json) fmt::print("written     {}\n", arguments.out);
  }
  return 0;
}

std::vector<CLI::Option*> add_set_options(CLI::App& command, PlanMfbCommand& arguments) {
  return {
      command
          .add_option("--stylus-mm", arguments.styli,
                      "x,y,z: tool reference point to tip, machine axes, mm; once for each\n"
                      "stylus. The stem is across the ram if the tip is 20 mm beside it, else\n"
                      "along it; x,y,z,-x states it")
          ->expected(1)
          ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll),
      command
          .add_option("--set", arguments.set,
                      "paper: 17 measurements in 14 positions; rolled: the same with X3 rolled by\n"
                      "90 degrees, which shows EZX and EB0Z better; minimum: 12 measurements;\n"
                      "indexed: rolled, in 6 clampings on a table with two rotary axes")
          ->check(CLI::IsMember(bar_plan_sets())),
      command.add_flag("--best", arguments.best,
                       "exchange positions against others while the worst uncertainty falls, with\n"
                       "as many positions and measurements; takes up to a minute"),
      command.add_option("--exchanges", arguments.exchanges, "with --best: at most this many")
          ->check(CLI::Range(0, 1000)),
      command.add_option("--rotary-at-mm", arguments.rotary_at,
                         "with --set indexed: x,y,z where the rotary axes cross, as a place of\n"
                         "the tip, mm; default: the middle of the travel"),
      command
          .add_option("--swivel", arguments.swivel, "with --set indexed: the axis that carries C'")
          ->check(CLI::IsMember({"A", "B"})),
      command
          .add_option("--overlap", arguments.overlap,
                      "share of the bar that neighbours on a longer axis have in common, at least")
          ->check(CLI::Range(0.1, 0.9)),
      command.add_flag("--forward-only", arguments.forward_only,
                       "no backward passes: a drift of the machine is not seen")};
}

std::vector<CLI::Option*> add_noise_options(CLI::App& command, PlanMfbCommand& arguments) {
  return {command.add_option("--tip-radius-mm", arguments.tip_radius_mm, "of the styli")
              ->check(CLI::NonNegativeNumber),
          command.add_option("--probe-um", arguments.probe_um, "standard deviation of a touch")
              ->check(CLI::NonNegativeNumber),
          command
              .add_option("--machine-um", arguments.machine_um,
                          "repeatability of the machine, each axis (k = 1)")
              ->check(CLI::NonNegativeNumber),
          command
              .add_option("--temperature-C", arguments.temperature_C,
                          "written for each pass if the bar expands; correct it when you measure")
              ->check(CLI::Range(-50.0, 100.0)),
          command
              .add_option("--u-temperature-K", arguments.u_temperature_K,
                          "standard uncertainty of the temperature of the bar")
              ->check(CLI::Range(0.0, 50.0))};
}

}  // namespace

void add_plan_mfb(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<PlanMfbCommand>();
  auto* command = parent.add_subcommand(
      "mfb",
      "Plan a calibration with a Multi-Feature Bar: where it is clamped and which styli probe it,\n"
      "for the travel of this machine. Writes plan.toml, and prints the predicted uncertainty of\n"
      "each of the 21 errors. An axis longer than the bar gets bars that overlap; along a shorter\n"
      "one the bar is inclined. Collisions are not considered.");
  command->add_option("--machine,-c", arguments->machine, "machine.toml or the daemon's abbed.toml")
      ->required();
  command->add_option("--bar", arguments->bar, "bar.toml")->required();
  auto planning = add_set_options(*command, *arguments);
  for (auto* option : add_noise_options(*command, *arguments)) planning.push_back(option);
  planning.push_back(command->add_option("-o,--out", arguments->out, "the plan.toml to write"));
  for (auto* option : planning)
    if (option->get_expected_max() > 0 && option->get_name() != "--stylus-mm" &&
        option->get_name() != "--rotary-at-mm" && option->get_name() != "--out")
      option->capture_default_str();
  auto* check = command->add_option("--check", arguments->check,
                                    "plan.toml: judge this plan instead of making one");
  for (auto* option : planning) check->excludes(option);
  command
      ->add_option("--feed-mm-per-min", arguments->feed_mm_per_min,
                   "between touches, mm/min, for the duration")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command
      ->add_option("--probing-feed-mm-per-min", arguments->probing_feed_mm_per_min,
                   "to the surface, mm/min, for the duration")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_flag("--json", arguments->json, "print the figures as one JSON object");

  command->callback([arguments, &exit] {
    exit = arguments->check.empty() && arguments->styli.empty()
               ? report({ErrorCode::Usage,
                         "plan mfb needs the styli, for example --stylus-mm=0,0,-150 "
                         "--stylus-mm=100,0,-150 --stylus-mm=-100,0,-150, or --check plan.toml"})
               : run(*arguments);
  });
}

}  // namespace abbe::daemon

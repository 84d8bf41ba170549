/// abbe-sim mfb: a simulated machine measures a Multi-Feature Bar. The command writes the files for
/// `abbe identify mfb`, and the true errors.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <memory>
#include <utility>

#include "abbe/sim/mfb/live_probing.hpp"
#include "abbe/sim/random_truth.hpp"
#include "abbe/sim/truth_table.hpp"
#include "bar_options.hpp"
#include "commands.hpp"
#include "setup_file.hpp"
#include "touching_loop.hpp"
#include "verification_points.hpp"

namespace abbe::sim {
namespace {

/// Options of a live simulation: with a [sim] table the machine and its devices are simulated, too.
struct LiveOptions {
  SetupChoices choices;
  std::string ports_file;
  bool start_on_signal = false;
  std::size_t from = 0;  ///< number of the first touch
  std::vector<std::size_t> silent, doubled, stray;
};

struct MfbOptions : BarOptions {
  LiveOptions live;
  std::string plan = "17", passes = "pairs";
  std::uint64_t waves = 3;
  double drift_um = 0.0;
  std::vector<double> u_bar_um{0.2, 0.35, 0.35};
};

const std::map<std::string, mfb::PlanKind> kPlans{{"17", mfb::PlanKind::Full},
                                                  {"12", mfb::PlanKind::Fewest},
                                                  {"17-rolled", mfb::PlanKind::FullRolled}};
const std::map<std::string, mfb::Passes> kPasses{{"pairs", mfb::Passes::Pairs},
                                                 {"forward", mfb::Passes::ForwardAlone}};

/// A machine whose error tables are smooth also beyond the travel, because the outer touches are
/// there.
TruthMachine cube_machine(const MfbOptions& options) {
  TruthMachine machine;
  for (const Axis axis : kAxes) machine.axis(axis).range = {0.0, options.length_m(), 0.0};
  return random_truth(machine, {.seed = options.seed,
                                .mean_error_m = options.mean_error_um * kFromMicro,
                                .node_spacing_m = 0.005,
                                .beyond_m = 0.025,
                                .shape = Shape::Cubic,
                                .harmonics = options.waves});
}

Result<mfb::ProbingOptions> stated_options(const MfbOptions& options) {
  auto stated = probing_of(options);
  if (stated) stated->drift_m = options.drift_um * kFromMicro;
  return stated;
}

std::string sim_toml(const MfbOptions& options) {
  return fmt::format(
      "# The machine that was measured, for abbe-sim truth --config\n"
      "[sim]\nmachine = \"machine.toml\"\nseed = {}\n"
      "[sim.truth]\nfile = \"truth.csv\"\nshape = \"cubic\"\n",
      options.seed);
}

/// Simulates scales and probe on a counter card, with the same touches as in points.csv.
int run_live(const MfbOptions& options, const TruthMachine& machine, mfb::ProbedBar probed) {
  const std::size_t from = std::min(options.live.from, probed.touches.size());
  probed.touches.erase(probed.touches.begin(),
                       probed.touches.begin() + static_cast<std::ptrdiff_t>(from));
  auto setup = load_setup(options.live.choices);
  if (!setup) return report(setup.error());
  SimulationSetup& simulation = setup->simulation;
  if (simulation.counter_cards.empty())
    return report({ErrorCode::BadInput,
                   "the machine file has no [counter_card], which counts the axes and the probe: "
                   "add it"});
  mfb::LiveProbing probing{.seed = options.seed};
  probing.missed.insert(options.live.silent.begin(), options.live.silent.end());
  probing.doubled.insert(options.live.doubled.begin(), options.live.doubled.end());
  probing.stray.insert(options.live.stray.begin(), options.live.stray.end());
  const auto program = mfb::live_program(probed, probing);
  if (!program) return report(program.error());

  simulation.truth = machine;
  simulation.tracker.reset();
  simulation.bus.reset();
  simulation.held = options.live.start_on_signal;
  simulation.path = program->path;
  simulation.edges_s = program->edges_s;
  return run_touching(simulation,
                      {.ports_file = options.live.ports_file,
                       .start_on_signal = options.live.start_on_signal,
                       .speed = setup->speed},
                      fmt::format("{} touches", probed.touches.size()));
}

int run(const MfbOptions& options) {
  const auto stated = stated_options(options);
  if (!stated) return report(stated.error());
  const mfb::TrueBar bar = bar_of(options);
  const TruthMachine machine = cube_machine(options);
  TruthMachine with_first_tool = machine;
  const auto plan =
      mfb::reference_plan(kPlans.at(options.plan), kPasses.at(options.passes), options.length_m());
  auto probed = mfb::probe_bar(machine, bar, plan, simulated(*stated, options));
  if (!probed) return report(as_usage(probed.error()));

  with_first_tool.target_offset_m = plan.front().tool_offset_m;
  const Eigen::Vector3d u_bar_m = kFromMicro * Eigen::Vector3d(options.u_bar_um.data());
  mfb::StatedBar calibrated = mfb::calibrated_bar(bar, u_bar_m, options.seed);
  if (options.exact) {
    calibrated.O_m = mfb::calibrated_bar(bar, Eigen::Vector3d::Zero(), options.seed).O_m;
  }
  set_properties(calibrated, *stated);
  const std::string name = fmt::format("simulated, seed {}", options.seed);
  const auto written = write_folder(
      options.folder,
      {{"machine.toml", mfb::format_machine_toml(machine, name, options.pitch_mm * kFromMilli)},
       {"bar.toml", mfb::format_bar_toml(calibrated)},
       {"plan.toml", mfb::format_plan_toml(plan, *probed, *stated)},
       {"points.csv", mfb::format_points_csv(plan, *probed)},
       {"truth.csv", format_truth_csv(machine)},
       {"sim.toml", sim_toml(options)},
       {"truebar.csv", mfb::format_points_of_interest_csv(mfb::points_of_interest_m(bar))},
       {"verification.csv", verification_csv(with_first_tool)}});
  if (!written) return report(written.error());
  fmt::print("{} touches in {} passes; mean |V| {:.1f} um; files in {}\n", probed->touches.size(),
             plan.size(), mean_error_m(machine) / kFromMicro, options.folder);
  return options.live.choices.config_file.empty() ? kDone
                                                  : run_live(options, machine, *std::move(probed));
}

void add_live_options(CLI::App& sub, LiveOptions& live) {
  live.choices.needs_path = false;
  auto* config =
      sub.add_option(
             "--config", live.choices.config_file,
             "TOML file with a [sim] table: after the files are written, the machine makes\n"
             "the touches, scales and probe on the counter card of its machine file, on\n"
             "127.0.0.1 until SIGINT or SIGTERM; then `abbe calibrate mfb`")
          ->type_name("FILE");
  sub.add_option("--speed", live.choices.speed,
                 "simulated seconds per second; the daemon must be given the same")
      ->check(CLI::Range(1e-3, 1e4))
      ->needs(config);
  sub.add_option("--usbip-port", live.choices.usbip_port,
                 "TCP, of the counter card; 0 = any free one")
      ->needs(config);
  sub.add_flag("--start-on-signal", live.start_on_signal,
               "start on SIGUSR1; default: when the card is scanning; then [sim.path] standstill_s")
      ->needs(config);
  sub.add_option("--ports-file", live.ports_file, "written when the card listens: usbip_port=N")
      ->type_name("FILE")
      ->needs(config);
  sub.add_option("--from", live.from,
                 "begins with this touch, by number from 0: the session before was interrupted")
      ->needs(config);
  sub.add_option("--silent", live.silent,
                 "touches that the probe does not report, by number from 0")
      ->needs(config);
  sub.add_option("--double", live.doubled, "touches made twice, by number")->needs(config);
  sub.add_option("--stray", live.stray, "before these touches, a trigger far from the bar")
      ->needs(config);
}

MfbOptions standard_options() {
  MfbOptions options;
  options.mean_error_um = 40.0;
  return options;
}

}  // namespace

int write_bar_set(const std::string& folder) {
  MfbOptions options = standard_options();
  options.folder = folder;
  return run(options);
}

Subcommand add_mfb(CLI::App& app) {
  // lives as long as the command line's callbacks
  auto options = std::make_shared<MfbOptions>(standard_options());
  CLI::App* sub = app.add_subcommand(
      "mfb",
      "a simulated machine measures a Multi-Feature Bar: bar.toml, plan.toml, points.csv and\n"
      "machine.toml for `abbe identify mfb`; its true errors: truth.csv with sim.toml (abbe-sim\n"
      "truth --config), verification.csv (abbe verify --points), truebar.csv (the bar)");
  add_bar_options(*sub, *options);
  add_live_options(*sub, options->live);
  sub->add_option(
         "--plan", options->plan,
         "17 measurements; 12, the least that show all errors; 17-rolled, the holes of X3 along Y")
      ->check(CLI::IsMember({"17", "12", "17-rolled"}));
  sub->add_option("--passes", options->passes, "every pass and its way back, or forward alone")
      ->check(CLI::IsMember({"pairs", "forward"}));
  sub->add_option(
         "--waves", options->waves,
         "sine waves in each error of the machine: 4 waves bend more between nodes of 50 mm "
         "than a cubic follows (0.1 um)")
      ->check(CLI::Range(1, 4));
  sub->add_option("--drift-um", options->drift_um,
                  "the bar drifts this far along each axis in a pass")
      ->check(CLI::Range(0.0, 1000.0));
  sub->add_option("--u-bar-um", options->u_bar_um,
                  "standard uncertainty of the calibrated points in x, y, z")
      ->delimiter(',')
      ->expected(3)
      ->check(CLI::Range(0.0, 100.0));

  return {sub, [options] { return run(*options); }};
}

}  // namespace abbe::sim

/// abbe-sim bar: a simulated measuring machine calibrates a Multi-Feature Bar by reversal. The
/// command writes the files for `abbe identify bar`, and the true bar.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <string_view>
#include <utility>

#include "abbe/result/try.hpp"
#include "abbe/sim/mfb/reversal.hpp"
#include "bar_options.hpp"
#include "clamping_loop.hpp"
#include "commands.hpp"
#include "setup_file.hpp"

namespace abbe::sim {
namespace {

struct ReversalCommandOptions : BarOptions {
  SetupChoices choices;  ///< with a [sim] table the measuring machine is simulated as a device, too
  std::string ports_file;
  std::size_t repeats = 5;
  double shape_scatter_um = 0.3;
  std::vector<double> gauge_beside_mm{0.0, 0.0};
  double u_rotation_urad = 2.0, gauge_step_mm = 25.0, u_gauge_um = 0.15, u_gauge_um_per_m = 0.75;
  /// inclination of bar and gauge; the plan states that they are along X
  double inclined_mrad = 0.0;
  std::vector<double> gauge_turned_mrad{0.0, 0.0};
  double gauge_alignment_mrad = 0.25;
  std::string gauge_travel = "bar";
};

mfb::GaugeTravel travel_of(std::string_view word) {
  if (word == "gauge") return mfb::GaugeTravel::AlongGauge;
  return word == "x" ? mfb::GaugeTravel::AlongX : mfb::GaugeTravel::AlongBar;
}

mfb::StepGauge gauge_of(const ReversalCommandOptions& o) {
  return {
      .step_m = o.gauge_step_mm * kFromMilli,
      .u_m = o.u_gauge_um * kFromMicro,
      .u_per_m = o.u_gauge_um_per_m * kFromMicro,
      .temperature_C = o.temperature_C,
      .beside_bar_m = {0.0, o.gauge_beside_mm[0] * kFromMilli, o.gauge_beside_mm[1] * kFromMilli},
      .turned_rad = {o.gauge_turned_mrad[0] * kFromMilli, o.gauge_turned_mrad[1] * kFromMilli},
      .alignment_rad = o.gauge_alignment_mrad * kFromMilli,
      .travel = travel_of(o.gauge_travel),
      .u_rotation_rad = o.u_rotation_urad * kFromMicro};
}

void without_errors(mfb::StepGauge& gauge) {
  gauge.u_m = gauge.u_per_m = gauge.u_alpha_per_K = gauge.u_temperature_K = 0.0;
  gauge.alignment_rad = 0.0;
}

/// The bar and the machine that calibrates it.
struct Reversal {
  mfb::ProbingOptions stated;
  mfb::TrueBar bar;
  TruthMachine machine;
  mfb::StepGauge gauge;          ///< gauge as gauge.toml states it
  mfb::ReversalOptions applied;  ///< options of the simulation
};

Result<Reversal> reversal_of(const ReversalCommandOptions& options) {
  auto stated = probing_of(options);
  ABBE_TRY(stated);
  stated->shape_scatter_m = options.shape_scatter_um * kFromMicro;
  Reversal out{
      *stated,
      bar_of(options),
      mfb::measuring_machine(options.mean_error_um * kFromMicro, options.length_m(), options.seed),
      gauge_of(options),
      {.repeats = options.repeats,
       .inclination_rad = options.inclined_mrad * kFromMilli,
       .planned_inclination_rad = 0.0,
       .probing = simulated(*stated, options)}};
  out.applied.gauge = out.gauge;
  if (options.exact) without_errors(out.applied.gauge);
  return out;
}

/// Writes the files of `abbe identify bar` and `abbe calibrate bar`. `points`: a further file, or
/// none.
Result<void> write_files(const ReversalCommandOptions& options, const Reversal& reversal,
                         const mfb::ReversalRun& run, std::vector<NamedText> points) {
  constexpr double kTolerance_um = 50.0;  // tolerance of the manufacturer
  const mfb::TrueBar& bar = reversal.bar;
  mfb::StatedBar nominal =
      mfb::nominal_bar(bar.pattern, Eigen::Vector3d::Constant(kTolerance_um * kFromMicro));
  set_properties(nominal, reversal.stated);
  std::vector<NamedText> files = std::move(points);
  files.push_back({"nominal.toml", mfb::format_bar_toml(nominal)});
  files.push_back({"plan.toml", mfb::format_plan_toml(run.plan, run.probed, reversal.stated)});
  files.push_back(
      {"gauge.toml", mfb::format_gauge_toml(run, reversal.gauge, reversal.applied.tool_offset_m)});
  files.push_back(
      {"truebar.csv", mfb::format_points_of_interest_csv(mfb::points_of_interest_m(bar))});
  return write_folder(options.folder, files);
}

int run_offline(const ReversalCommandOptions& options, const Reversal& reversal) {
  const auto found = mfb::run_reversal(reversal.machine, reversal.bar, reversal.applied);
  if (!found) return report(as_usage(found.error()));
  const auto written =
      write_files(options, reversal, *found,
                  {{"points.csv", mfb::format_points_csv(found->plan, found->probed)}});
  if (!written) return report(written.error());
  fmt::print("{} touches in {} normal and {} reversed passes; files in {}\n",
             found->probed.touches.size(), options.repeats, options.repeats, options.folder);
  return kDone;
}

/// The faces of the gauge, which are across it.
std::vector<Face> faces_of_gauge(const Reversal& reversal) {
  constexpr double kHalfSize_m = 4e-3;
  const Eigen::Vector3d outward = -mfb::gauge_direction(reversal.applied);
  std::vector<Face> faces;
  for (const Eigen::Vector3d& tip_m :
       mfb::gauge_faces_m(reversal.machine, reversal.bar.pattern.length_m(), reversal.applied)) {
    const double radius_m = reversal.applied.probing.probe.tip_radius_m;
    faces.push_back({tip_m - radius_m * outward, outward, kHalfSize_m});
  }
  return faces;
}

/// Simulates the measuring machine over I++ DME: on its table are one clamping of the bar after the
/// other, then the gauge.
int run_live(const ReversalCommandOptions& options, Reversal reversal) {
  auto setup = load_setup(options.choices);
  if (!setup) return report(setup.error());
  SimulationSetup& simulation = setup->simulation;
  if (!simulation.measuring_machine)
    return report({ErrorCode::BadInput,
                   "the machine file has no [cmm], the measuring machine over I++ DME: add it"});

  reversal.applied.tool_offset_m.setZero();  // the machine reports the centre of the tip
  const mfb::ProbingOptions& probing = reversal.applied.probing;
  MeasuringMachine machine = simulation.measuring_machine->machine;
  machine.truth = reversal.machine;
  machine.tip_radius_m = probing.probe.tip_radius_m;
  machine.noise_m = std::hypot(probing.probe.noise_m, probing.machine_noise_m);
  machine.seed = options.seed;

  mfb::ReversalRun run;
  run.plan = mfb::reversal_plan(reversal.machine, reversal.applied);
  std::vector<OnTable> things;
  for (std::size_t m = 0; m < run.plan.size(); ++m) {
    machine.bar = mfb::clamped(reversal.bar, run.plan, m, probing);
    run.probed.temperature_C.push_back(machine.bar->stated_C);
    things.push_back({run.plan[m].name, machine});
  }
  machine.bar.reset();
  machine.faces = faces_of_gauge(reversal);
  things.push_back({"step gauge", machine});
  run.distances_m = mfb::gauge_distances_m(reversal.bar.pattern.length_m(), reversal.applied.gauge);
  run.gauge_origin_m = mfb::gauge_origin_m(reversal.machine, reversal.applied);
  run.plan = mfb::as_planned(std::move(run.plan), reversal.applied);

  if (const auto written = write_files(options, reversal, run, {}); !written)
    return report(written.error());
  simulation.truth = reversal.machine;
  simulation.path.vertices = {PathVertex{}};
  simulation.held = true;
  return run_clamping(std::move(simulation), things,
                      {.ports_file = options.ports_file, .speed = setup->speed});
}

int run(const ReversalCommandOptions& options) {
  const auto reversal = reversal_of(options);
  if (!reversal) return report(reversal.error());
  return options.choices.config_file.empty() ? run_offline(options, *reversal)
                                             : run_live(options, *reversal);
}

void add_live(CLI::App& sub, ReversalCommandOptions& o) {
  o.choices.needs_path = false;
  auto* config = sub.add_option(
      "--config", o.choices.config_file,
      "TOML file with a [sim] table: after the files are written, a measuring machine with the\n"
      "bar as clamped for the first pass, over I++ DME as its machine file states in [cmm], on\n"
      "127.0.0.1 until SIGINT or SIGTERM; SIGUSR1 clamps it for the next pass, at last the step\n"
      "gauge; then `abbe calibrate bar`. gauge.toml has no readings, and there is no points.csv");
  config->type_name("FILE");
  sub.add_option("--speed", o.choices.speed,
                 "simulated seconds per second; the daemon must be given the same")
      ->check(CLI::Range(1e-3, 1e4))
      ->needs(config);
  sub.add_option("--ports-file", o.ports_file, "written when the machine listens: cmm_port=N")
      ->type_name("FILE")
      ->needs(config);
}

void add_reversal(CLI::App& sub, ReversalCommandOptions& o) {
  sub.add_option("--repeats", o.repeats, "normal passes, and as many reversed ones")
      ->check(CLI::Range(1, 50));
  sub.add_option("--shape-um", o.shape_scatter_um,
                 "the clamping bends the bar: standard deviation of each hole and pass")
      ->check(CLI::Range(0.0, 100.0));
  sub.add_option("--gauge-beside-mm", o.gauge_beside_mm,
                 "y and z of the line of the step gauge from the line of the bar")
      ->delimiter(',')
      ->expected(2)
      ->check(CLI::Range(-1000.0, 1000.0));
  sub.add_option("--inclined-mrad", o.inclined_mrad,
                 "angle of bar and gauge to X, which plan.toml states, in the plane of X and Y")
      ->check(CLI::Range(-50.0, 50.0));
  sub.add_option("--gauge-turned-mrad", o.gauge_turned_mrad,
                 "the gauge is turned from the bar by these angles, about z and about y")
      ->delimiter(',')
      ->expected(2)
      ->check(CLI::Range(-50.0, 50.0));
  sub.add_option("--gauge-alignment-mrad", o.gauge_alignment_mrad,
                 "and by random angles of this standard deviation")
      ->check(CLI::Range(0.0, 20.0));
  sub.add_option("--gauge-travel", o.gauge_travel, "the tip moves from face to face along this")
      ->check(CLI::IsMember({"bar", "gauge", "x"}));
  sub.add_option("--gauge-step-mm", o.gauge_step_mm, "distance of its faces")
      ->check(CLI::Range(5.0, 200.0));
  sub.add_option("--u-gauge-um", o.u_gauge_um, "standard uncertainty of a distance of the gauge")
      ->check(CLI::Range(0.0, 10.0));
  sub.add_option("--u-gauge-um-per-m", o.u_gauge_um_per_m, "in addition, in proportion to it")
      ->check(CLI::Range(0.0, 10.0));
  sub.add_option("--u-rotation-urad", o.u_rotation_urad,
                 "gauge.toml states this about the rotations of the machine")
      ->check(CLI::Range(0.0, 1000.0));
}

}  // namespace

Subcommand add_bar(CLI::App& app) {
  auto options =
      std::make_shared<ReversalCommandOptions>();  // lives as long as the command line's callbacks
  options->mean_error_um = 2.0;
  options->probe_um = 0.05;
  options->machine_um = 0.1;
  options->temperature_spread_K = 0.05;
  options->u_temperature_K = 0.02;
  CLI::App* sub = app.add_subcommand(
      "bar",
      "a simulated measuring machine calibrates a Multi-Feature Bar by reversal: nominal.toml,\n"
      "plan.toml, points.csv and gauge.toml for `abbe identify bar`; truebar.csv is the true bar.\n"
      "With the same --bar-seed it is the bar of `abbe-sim mfb`");
  add_bar_options(*sub, *options);
  add_reversal(*sub, *options);
  add_live(*sub, *options);

  return {sub, [options] { return run(*options); }};
}

}  // namespace abbe::sim

/// abbe-sim evemu: the weak-stiffness machine touches a ball array at eight positions; a daemon
/// reads scales and probe from the simulated counter card.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iterator>
#include <memory>

#include "abbe/sim/simulation.hpp"
#include "commands.hpp"
#include "files.hpp"
#include "reference_points.hpp"
#include "setup_file.hpp"
#include "touching_loop.hpp"

namespace abbe::sim {
namespace {

struct EvemuOptions {
  SetupChoices choices;
  std::size_t points_per_ball = 0, points_per_block = 0;  // 0: the value in the file
  std::vector<std::size_t> missed, doubled, stray;
  std::string ports_file, calibrator_out, truth_out, reference_out;
  double u_reference_um = 5.0;
  bool start_on_signal = false;
};

Result<LoadedSetup> load(const EvemuOptions& options) {
  auto setup = load_setup(options.choices);
  if (!setup) return setup;
  SimulationSetup& simulation = setup->simulation;
  if (simulation.truth.order != std::array{Axis::Z, Axis::X, Axis::Y})
    return bad_input(
        "the machine file has another chain than the weak-stiffness machine: set [machine] chain = "
        "\"[w b Z X Y t]\"");
  if (simulation.counter_cards.empty())
    return bad_input(
        "the machine file has no [counter_card], which counts the axes and the probe: add it");
  simulation.truth = weak_stiffness_machine(setup->weak_stiffness);
  simulation.tracker.reset();
  simulation.bus.reset();
  simulation.held = options.start_on_signal;
  TouchingOptions& touching = setup->touching;
  touching.seed = simulation.counter_cards.front().seed;
  if (options.points_per_ball > 0) touching.points_per_ball = options.points_per_ball;
  if (options.points_per_block > 0) touching.points_per_block = options.points_per_block;
  touching.missed.insert(options.missed.begin(), options.missed.end());
  touching.doubled.insert(options.doubled.begin(), options.doubled.end());
  touching.stray.insert(options.stray.begin(), options.stray.end());

  return setup;
}

/// V minus V at ball 1, as CSV, on a grid over the smallest box that contains all balls.
std::string truth_csv(const TruthMachine& truth, const BallArray& array) {
  const Eigen::Vector3d step_m = Eigen::Vector3d(0.1, 0.05, 0.01) / 3.0;
  const auto readings = ball_readings_m(truth, array);
  Eigen::Vector3d low = readings.front(), high = readings.front();

  for (const auto& q_m : readings) {
    low = low.cwiseMin(q_m);
    high = high.cwiseMax(q_m);
  }

  using Steps = Eigen::Matrix<Eigen::Index, 3, 1>;
  const Steps first = low.cwiseQuotient(step_m).array().ceil().cast<Eigen::Index>();
  const Steps last = high.cwiseQuotient(step_m).array().floor().cast<Eigen::Index>();
  const Eigen::Vector3d V_ball1_m = error_m(truth, readings.front());
  std::string text = "x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";

  for (Eigen::Index x = first.x(); x <= last.x(); ++x) {
    for (Eigen::Index y = first.y(); y <= last.y(); ++y) {
      for (Eigen::Index z = first.z(); z <= last.z(); ++z)
        text += error_row(truth, step_m.cwiseProduct(Steps(x, y, z).cast<double>()), V_ball1_m);
    }
  }

  return text;
}

Result<void> write_files(const EvemuOptions& options, const LoadedSetup& setup,
                         const BallArray& array) {
  const TruthMachine& truth = setup.simulation.truth;
  const auto write = [](const std::string& file, const auto& text) -> Result<void> {
    return file.empty() ? Result<void>{} : write_file(file, text());
  };
  return write(options.calibrator_out,
               [&] { return format_calibrator_toml(reference_ball_array(), setup.array); })
      .and_then([&] { return write(options.truth_out, [&] { return truth_csv(truth, array); }); })
      .and_then([&] {
        return write(options.reference_out, [&] {
          return reference_csv(truth, array, options.u_reference_um / 1e6, setup.touching.seed);
        });
      });
}

int run(const EvemuOptions& options) {
  auto setup = load(options);
  if (!setup) return report(setup.error());
  const BallArray array = true_array(reference_ball_array(), setup->array);
  if (const auto written = write_files(options, *setup, array); !written)
    return report(written.error());
  const TruthMachine& truth = setup->simulation.truth;
  const TouchingProgram program = plan_touching(truth, array, setup->touching);
  setup->simulation.path = program.path;
  const auto motion = PathMotion::plan(program.path);
  if (!motion) return report(motion.error());
  setup->simulation.edges_s =
      edge_times_s(program, truth, *motion, array.tip_radius_m, setup->touching);
  return run_touching(setup->simulation,
                      {.ports_file = options.ports_file,
                       .start_on_signal = options.start_on_signal,
                       .speed = setup->speed},
                      fmt::format("{} touches", program.moves.size()));
}

}  // namespace

Subcommand add_evemu(CLI::App& app) {
  auto options = std::make_shared<EvemuOptions>();  // lives as long as the command line's callbacks
  options->choices.needs_path = false;
  CLI::App* sub =
      app.add_subcommand("evemu",
                         "the weak-stiffness machine touches a ball array at eight positions: "
                         "scales and probe on the counter\n"
                         "card, on 127.0.0.1 until SIGINT or SIGTERM; then `abbe calibrate evemu`");
  SetupChoices& choices = options->choices;
  sub->add_option("--config", choices.config_file, "TOML file with a [sim] table")
      ->type_name("FILE");
  sub->add_option("--machine", choices.machine_file,
                  "machine description with [counter_card], e.g. abbed.toml")
      ->type_name("FILE");
  sub->add_option("--seed", choices.seed, "seed of all noise (default 1)");
  sub->add_option("--speed", choices.speed,
                  "simulated seconds per second; the daemon must be given the same")
      ->check(CLI::Range(1e-3, 1e4));
  sub->add_option("--usbip-port", choices.usbip_port, "TCP, of the counter card; 0 = any free one");
  sub->add_option("--points-per-ball", options->points_per_ball, "default 25")
      ->check(CLI::Range(1, 1000));
  sub->add_option("--points-per-block", options->points_per_block, "default 25")
      ->check(CLI::Range(1, 1000));
  sub->add_option("--miss", options->missed,
                  "touches that the probe does not report, by number from 0");
  sub->add_option("--double", options->doubled, "touches made twice, by number");
  sub->add_option("--stray", options->stray, "before these touches, a trigger far from any ball");
  sub->add_flag(
      "--start-on-signal", options->start_on_signal,
      "start on SIGUSR1; default: when the card is scanning; then [sim.path] standstill_s");
  sub->add_option("--ports-file", options->ports_file,
                  "written when the card listens: usbip_port=N")
      ->type_name("FILE");
  sub->add_option("--calibrator-out", options->calibrator_out, "write calibrator.toml of the array")
      ->type_name("FILE");
  sub->add_option("--truth-out", options->truth_out,
                  "write V relative to ball 1 over its volume as CSV")
      ->type_name("FILE");
  CLI::Option* reference = sub->add_option("--reference-out", options->reference_out,
                                           "write V at the balls as measured by an independent "
                                           "instrument, for --rotation-reference")
                               ->type_name("FILE");
  sub->add_option("--u-reference-um", options->u_reference_um,
                  "standard deviation of that instrument's noise (default 5)")
      ->needs(reference);

  return {sub, [options] { return run(*options); }};
}

}  // namespace abbe::sim

/// abbe-sim bar: a simulated measuring machine calibrates a Multi-Feature Bar by reversal; the
/// files for `abbe identify bar`, and the true bar.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "abbe/sim/mfb/reversal.hpp"
#include "bar_options.hpp"
#include "commands.hpp"
#include "toml_section.hpp"

namespace abbe::sim {
namespace {

struct ReversalCommandOptions : BarOptions {
  std::size_t repeats = 5;
  double shape_scatter_um = 0.3;
  std::vector<double> gauge_beside_mm{0.0, 0.0};
  double u_rotation_urad = 2.0, gauge_step_mm = 25.0, u_gauge_um = 0.15, u_gauge_um_per_m = 0.75;
};

mfb::StepGauge gauge_of(const ReversalCommandOptions& o) {
  return {.step_m = o.gauge_step_mm * kMilli,
          .u_m = o.u_gauge_um * kMicro,
          .u_per_m = o.u_gauge_um_per_m * kMicro,
          .temperature_C = o.temperature_C,
          .beside_bar_m = {0.0, o.gauge_beside_mm[0] * kMilli, o.gauge_beside_mm[1] * kMilli},
          .u_rotation_rad = o.u_rotation_urad * kMicro};
}

void without_errors(mfb::StepGauge& gauge) {
  gauge.u_m = gauge.u_per_m = gauge.u_alpha_per_K = gauge.u_temperature_K = 0.0;
}

int run(const ReversalCommandOptions& options) {
  auto stated = probing_of(options);
  if (!stated) return report(stated.error());
  stated->shape_scatter_m = options.shape_scatter_um * kMicro;
  const mfb::TrueBar bar = bar_of(options);
  const TruthMachine machine =
      mfb::measuring_machine(options.mean_error_um * kMicro, options.length_m(), options.seed);
  const mfb::StepGauge gauge = gauge_of(options);
  mfb::ReversalOptions applied{options.repeats, simulated(*stated, options), gauge};
  if (options.exact) without_errors(applied.gauge);
  const auto found = mfb::run_reversal(machine, bar, applied);
  if (!found) return report(as_usage(found.error()));

  constexpr double kTolerance_um = 50.0;  // of the maker
  mfb::StatedBar nominal =
      mfb::nominal_bar(bar.pattern, Eigen::Vector3d::Constant(kTolerance_um * kMicro));
  set_properties(nominal, *stated);
  const auto written = write_folder(
      options.folder,
      {{"nominal.toml", mfb::format_bar_toml(nominal)},
       {"plan.toml", mfb::format_plan_toml(found->plan, found->probed, *stated)},
       {"points.csv", mfb::format_points_csv(found->plan, found->probed)},
       {"gauge.toml", mfb::format_gauge_toml(*found, gauge)},
       {"truebar.csv", mfb::format_points_of_interest_csv(mfb::points_of_interest_m(bar))}});
  if (!written) return report(written.error());
  fmt::print("{} touches in {} normal and {} reversed passes; files in {}\n",
             found->probed.touches.size(), options.repeats, options.repeats, options.folder);
  return kDone;
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

  return {sub, [options] { return run(*options); }};
}

}  // namespace abbe::sim

#include "abbe/sim/mfb/reversal.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <iterator>

#include "abbe/sim/noise.hpp"
#include "abbe/sim/random_truth.hpp"
#include "abbe/sim/touching.hpp"
#include "mfb/constants.hpp"
#include "units.hpp"

namespace abbe::sim::mfb {
namespace {

using Eigen::Vector3d;

constexpr double kBeside_m = 0.05;  // travel of the machine beyond the bar, at both ends
const Vector3d kTool_m(0.0, 0.0, -0.15);
// The bar and the gauge lie in the middle of the travel of Y and Z.
constexpr double kMiddle = 0.5;

Vector3d bar_origin_m(const TruthMachine& machine) {
  const auto middle = [&](Axis axis) {
    const AxisRange& r = machine.axis(axis).range;
    return r.min_m + kMiddle * (r.max_m - r.min_m);
  };
  return Vector3d(kBeside_m, middle(Axis::Y), middle(Axis::Z)) + kTool_m;
}

std::vector<Measurement> reversal_plan(const TruthMachine& machine, std::size_t repeats) {
  std::vector<Measurement> plan;
  for (std::size_t repeat = 1; repeat <= repeats; ++repeat) {
    for (const bool reversed : {false, true}) {
      const std::string name = fmt::format("{}{}", reversed ? 'R' : 'N', repeat);
      plan.push_back({.name = name,
                      .position = name,
                      .origin_m = bar_origin_m(machine),
                      .bar_x = Vector3d::UnitX(),
                      .bar_z = (reversed ? -1.0 : 1.0) * Vector3d::UnitZ(),
                      .tool_offset_m = kTool_m,
                      .probed = reversed ? Probed::FromBelow : Probed::FromAbove});
    }
  }
  return plan;
}

/// Touches the faces of the gauge, run after run.
void measure_gauge(TruthMachine machine, double length_m, const ReversalOptions& options,
                   ReversalRun& run) {
  constexpr std::uint64_t kOfGauge = 1000000;  // numbers below: of the faces and runs
  const StepGauge& gauge = options.gauge;
  const auto draw = [&](std::uint64_t n) {
    return gaussian(options.probing.seed, NoiseStream::StepGauge, n);
  };

  machine.target_offset_m = kTool_m;
  run.gauge_origin_m =
      bar_origin_m(machine) + gauge.beside_bar_m - gauge.step_m * Vector3d::UnitX();
  const double slope = gauge.u_per_m * draw(kOfGauge);
  const double alpha_per_K = gauge.alpha_per_K + gauge.u_alpha_per_K * draw(kOfGauge + 1);
  const double true_C = gauge.temperature_C + gauge.u_temperature_K * draw(kOfGauge + 2);

  const auto steps = static_cast<std::size_t>(std::lround(length_m / gauge.step_m)) + 2;
  for (std::size_t i = 0; i <= steps; ++i) {
    const double stated_m = static_cast<double>(i) * gauge.step_m;
    const std::uint64_t first = i * (gauge.runs + 1);
    const double off_m = i == 0 ? 0.0 : gauge.u_m * draw(first) + slope * stated_m;
    const double true_m = (stated_m + off_m) * (1.0 + alpha_per_K * (true_C - kReference_C));
    const Vector3d face_m = run.gauge_origin_m + true_m * Vector3d::UnitX();
    run.distances_m.push_back(stated_m);
    auto& readings_m = run.readings_m.emplace_back();
    const double noise_m =
        std::hypot(options.probing.machine_noise_m, options.probing.probe.noise_m);
    for (std::size_t r = 0; r < gauge.runs; ++r)
      readings_m.push_back(reading_at_m(machine, face_m).x() + noise_m * draw(first + 1 + r));
  }
}

}  // namespace

TruthMachine measuring_machine(double mean_error_m, double bar_length_m, std::uint64_t seed) {
  TruthMachine machine;
  for (const Axis axis : kAxes)
    machine.axis(axis).range = {0.0, bar_length_m + 2.0 * kBeside_m, 0.0};
  return random_truth(machine, {.seed = seed,
                                .mean_error_m = mean_error_m,
                                .node_spacing_m = 0.005,
                                .beyond_m = 0.025,
                                .shape = Shape::Cubic});
}

Result<ReversalRun> run_reversal(const TruthMachine& machine, const TrueBar& bar,
                                 const ReversalOptions& options) {
  ReversalRun run;
  run.plan = reversal_plan(machine, options.repeats);
  auto probed = probe_bar(machine, bar, run.plan, options.probing);
  if (!probed) return tl::unexpected(probed.error());
  run.probed = *std::move(probed);
  measure_gauge(machine, bar.pattern.length_m(), options, run);
  return run;
}

std::string format_gauge_toml(const ReversalRun& run, const StepGauge& gauge) {
  const auto vector_mm = [](const Vector3d& v_m) {
    return fmt::format("[{:.17g}, {:.17g}, {:.17g}]", kMmPerM * v_m.x(), kMmPerM * v_m.y(),
                       kMmPerM * v_m.z());
  };
  std::string text = fmt::format(
      "[gauge]\nname = \"{}\"\nu_um = {:.17g}\nu_um_per_m = {:.17g}\n"
      "alpha_um_per_m_K = {:.17g}\nu_alpha_um_per_m_K = {:.17g}\n"
      "temperature_C = {:.17g}\nu_temperature_K = {:.17g}\n"
      "origin_mm = {}\ntool_offset_mm = {}\nu_rotation_urad = {:.17g}\n",
      gauge.name, kUmPerM * gauge.u_m, kUmPerM * gauge.u_per_m, kUmPerM * gauge.alpha_per_K,
      kUmPerM * gauge.u_alpha_per_K, gauge.temperature_C, gauge.u_temperature_K,
      vector_mm(run.gauge_origin_m), vector_mm(kTool_m), kUmPerM * gauge.u_rotation_rad);

  for (std::size_t i = 0; i < run.distances_m.size(); ++i) {
    std::vector<double> readings_mm;
    for (const double r_m : run.readings_m[i]) readings_mm.push_back(kMmPerM * r_m);
    fmt::format_to(std::back_inserter(text),
                   "\n[[step]]\ndistance_mm = {:.17g}\nreadings_mm = [{:.17g}]\n",
                   kMmPerM * run.distances_m[i], fmt::join(readings_mm, ", "));
  }
  return text;
}

}  // namespace abbe::sim::mfb

#include "abbe/sim/mfb/reversal.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <cmath>
#include <iterator>

#include "abbe/result/try.hpp"
#include "abbe/sim/noise.hpp"
#include "abbe/sim/random_truth.hpp"
#include "abbe/sim/touching.hpp"
#include "mfb/constants.hpp"
#include "units.hpp"

namespace abbe::sim::mfb {
namespace {

using Eigen::Vector3d;

constexpr double kBeside_m = 0.05;  // travel of the machine beyond the bar, at both ends
// The bar and the gauge lie in the middle of the travel of Y and Z.
constexpr double kMiddle = 0.5;
constexpr double kMradPerRad = 1e3;

Vector3d bar_origin_m(const TruthMachine& machine, const ReversalOptions& options) {
  const auto middle = [&](Axis axis) {
    const AxisRange& r = machine.axis(axis).range;
    return r.min_m + kMiddle * (r.max_m - r.min_m);
  };
  return Vector3d(kBeside_m, middle(Axis::Y), middle(Axis::Z)) + options.tool_offset_m;
}

Vector3d inclined_x(double inclination_rad) {
  return {std::cos(inclination_rad), std::sin(inclination_rad), 0.0};
}
Vector3d bar_x(const ReversalOptions& options) {
  return inclined_x(options.inclination_rad);
}

Vector3d travel_of_tip(const ReversalOptions& options) {
  switch (options.gauge.travel) {
    case GaugeTravel::AlongBar:
      return bar_x(options);
    case GaugeTravel::AlongGauge:
      return gauge_direction(options);
    case GaugeTravel::AlongX:
      return Vector3d::UnitX();
  }
  return Vector3d::UnitX();
}

constexpr std::uint64_t kOfGauge = 1000000;  // random numbers of the whole gauge, from here on

/// Random numbers of the gauge; those of face i begin at number i (4 runs + 1).
struct GaugeDraw {
  const ReversalOptions& options;
  [[nodiscard]] double number(std::uint64_t n) const {
    return gaussian(options.probing.seed, NoiseStream::StepGauge, n);
  }
  [[nodiscard]] std::uint64_t first_of(std::size_t face) const {
    return face * (4 * options.gauge.runs + 1);
  }
};

/// Touches the faces of the gauge, run after run.
void measure_gauge(TruthMachine machine, double length_m, const ReversalOptions& options,
                   ReversalRun& run) {
  const GaugeDraw draw{options};
  const Vector3d travel = travel_of_tip(options);
  const std::vector<Vector3d> faces_m = gauge_faces_m(machine, length_m, options);
  machine.target_offset_m = options.tool_offset_m;
  run.gauge_origin_m = gauge_origin_m(machine, options);
  run.distances_m = gauge_distances_m(length_m, options.gauge);

  for (std::size_t i = 0; i < faces_m.size(); ++i) {
    auto& readings_m = run.readings_m.emplace_back();
    for (std::size_t r = 0; r < options.gauge.runs; ++r) {
      const std::uint64_t n = draw.first_of(i) + 1 + 4 * r;
      const Vector3d of_machine(draw.number(n), draw.number(n + 1), draw.number(n + 2));
      readings_m.emplace_back(reading_at_m(machine, faces_m[i]) +
                              options.probing.machine_noise_m * of_machine +
                              options.probing.probe.noise_m * draw.number(n + 3) * travel);
    }
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

std::vector<Measurement> reversal_plan(const TruthMachine& machine,
                                       const ReversalOptions& options) {
  std::vector<Measurement> plan;
  for (std::size_t repeat = 1; repeat <= options.repeats; ++repeat) {
    for (const bool reversed : {false, true}) {
      const std::string name = fmt::format("{}{}", reversed ? 'R' : 'N', repeat);
      plan.push_back({.name = name,
                      .position = name,
                      .origin_m = bar_origin_m(machine, options),
                      .bar_x = bar_x(options),
                      .bar_z = (reversed ? -1.0 : 1.0) * Vector3d::UnitZ(),
                      .tool_offset_m = options.tool_offset_m,
                      .probed = reversed ? Probed::FromBelow : Probed::FromAbove});
    }
  }
  return plan;
}

std::vector<Measurement> as_planned(std::vector<Measurement> plan, const ReversalOptions& options) {
  for (Measurement& m : plan)
    m.bar_x = inclined_x(options.planned_inclination_rad.value_or(options.inclination_rad));
  return plan;
}

Vector3d gauge_origin_m(const TruthMachine& machine, const ReversalOptions& options) {
  return bar_origin_m(machine, options) + options.gauge.beside_bar_m -
         options.gauge.step_m * bar_x(options);
}

std::vector<double> gauge_distances_m(double bar_length_m, const StepGauge& gauge) {
  const auto steps = static_cast<std::size_t>(std::lround(bar_length_m / gauge.step_m)) + 2;
  std::vector<double> distances_m;
  for (std::size_t i = 0; i <= steps; ++i)
    distances_m.push_back(static_cast<double>(i) * gauge.step_m);
  return distances_m;
}

Vector3d gauge_direction(const ReversalOptions& options) {
  const StepGauge& gauge = options.gauge;
  const GaugeDraw draw{options};
  const double about_z_rad = gauge.turned_rad(0) + gauge.alignment_rad * draw.number(kOfGauge + 3);
  const double about_y_rad = gauge.turned_rad(1) + gauge.alignment_rad * draw.number(kOfGauge + 4);
  const Vector3d x = bar_x(options), y = Vector3d::UnitZ().cross(x);
  return Eigen::AngleAxisd(about_z_rad, Vector3d::UnitZ()) *
         (Eigen::AngleAxisd(about_y_rad, y) * x);
}

std::vector<Vector3d> gauge_faces_m(const TruthMachine& machine, double bar_length_m,
                                    const ReversalOptions& options) {
  const StepGauge& gauge = options.gauge;
  const GaugeDraw draw{options};
  const Vector3d travel = travel_of_tip(options);
  const double along_gauge = travel.dot(gauge_direction(options));  // distance per travel
  const double slope = gauge.u_per_m * draw.number(kOfGauge);
  const double alpha_per_K = gauge.alpha_per_K + gauge.u_alpha_per_K * draw.number(kOfGauge + 1);
  const double true_C = gauge.temperature_C + gauge.u_temperature_K * draw.number(kOfGauge + 2);

  std::vector<Vector3d> faces_m;
  for (const double stated_m : gauge_distances_m(bar_length_m, gauge)) {
    const std::size_t i = faces_m.size();
    const double off_m =
        i == 0 ? 0.0 : gauge.u_m * draw.number(draw.first_of(i)) + slope * stated_m;
    const double true_m = (stated_m + off_m) * (1.0 + alpha_per_K * (true_C - kReference_C));
    faces_m.emplace_back(gauge_origin_m(machine, options) + true_m / along_gauge * travel);
  }
  return faces_m;
}

Result<ReversalRun> run_reversal(const TruthMachine& machine, const TrueBar& bar,
                                 const ReversalOptions& options) {
  ReversalRun run;
  run.plan = reversal_plan(machine, options);
  auto probed = probe_bar(machine, bar, run.plan, options.probing);
  ABBE_TRY(probed);
  run.probed = *std::move(probed);
  run.plan = as_planned(std::move(run.plan), options);
  measure_gauge(machine, bar.pattern.length_m(), options, run);
  return run;
}

std::string format_gauge_toml(const ReversalRun& run, const StepGauge& gauge,
                              const Vector3d& tool_offset_m) {
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
      vector_mm(run.gauge_origin_m), vector_mm(tool_offset_m), kUmPerM * gauge.u_rotation_rad);
  if (gauge.u_alignment_rad)
    text += fmt::format("u_alignment_mrad = {:.17g}\n", kMradPerRad * *gauge.u_alignment_rad);

  for (std::size_t i = 0; i < run.distances_m.size(); ++i) {
    fmt::format_to(std::back_inserter(text), "\n[[step]]\ndistance_mm = {:.17g}\n",
                   kMmPerM * run.distances_m[i]);
    if (run.readings_m.empty()) continue;
    std::vector<std::string> readings_mm;
    for (const Vector3d& r_m : run.readings_m[i]) readings_mm.push_back(vector_mm(r_m));
    fmt::format_to(std::back_inserter(text), "readings_mm = [{}]\n", fmt::join(readings_mm, ", "));
  }
  return text;
}

}  // namespace abbe::sim::mfb

#pragma once
/// What the simulator writes into files about a Multi-Feature Bar, as inputs of calib without the
/// way through the files.

#include <numbers>

#include "abbe/calib/mfb/identify/bar_calibration.hpp"
#include "abbe/sim/mfb/reversal.hpp"

namespace abbe::tests::mfb {

inline constexpr double kZeroCelsius_K = 273.15;

inline calib::mfb::TouchPattern pattern_of(const sim::mfb::Pattern& p) {
  const auto in_rad = [](std::vector<double> angles_deg) {
    for (double& a : angles_deg) {
      a *= std::numbers::pi / 180.0;
    }
    return angles_deg;
  };
  return {.hole_x_m = p.hole_x_m,
          .hole_y_m = p.hole_y_m,
          .rod_x_m = p.rod_x_m,
          .hole_radius_m = p.hole_radius_m,
          .hole_levels_m = p.hole_levels_m,
          .hole_angles_rad = in_rad(p.hole_angles_deg),
          .rod_radius_m = p.rod_radius_m,
          .rod_sections_m = p.rod_sections_m,
          .rod_angles_rad = in_rad(p.rod_angles_deg),
          .plane_y_m = p.plane_y_m,
          .plane_dx_m = p.plane_dx_m,
          .plane_dz_m = p.plane_dz_m};
}

inline calib::mfb::Bar bar_of(const sim::mfb::StatedBar& stated) {
  calib::mfb::Bar bar{.name = stated.name, .pattern = pattern_of(stated.pattern)};
  bar.O_m = stated.O_m;
  Eigen::VectorXd variances(3 * std::ssize(stated.u_m));
  for (std::size_t i = 0; i < stated.u_m.size(); ++i) {
    variances.segment<3>(3 * static_cast<Eigen::Index>(i)) = stated.u_m[i].cwiseAbs2();
  }
  bar.covariance_m2 = variances.asDiagonal();
  if (stated.alpha_per_K != 0.0 || stated.u_alpha_per_K != 0.0) {
    bar.expansion = calib::Expansivity{stated.alpha_per_K, stated.u_alpha_per_K};
  }
  if (const auto& sag = stated.sag) {
    bar.sag = calib::mfb::Sag{sag->beam_x_m, sag->supports_m, sag->section_yz_m,
                              sag->density_kg_per_m3, sag->youngs_modulus_Pa};
  }
  return bar;
}

inline calib::mfb::Plan plan_of(std::span<const sim::mfb::Measurement> measurements,
                                const sim::mfb::ProbedBar& probed,
                                const sim::mfb::ProbingOptions& stated) {
  calib::mfb::Plan plan{
      .tip_radius_m = stated.probe.tip_radius_m,
      .noise = {stated.probe.noise_m, stated.machine_noise_m, stated.temperature.u_K},
      .gravity = stated.gravity};
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    const sim::mfb::Measurement& m = measurements[i];
    plan.measurements.push_back({.name = m.name,
                                 .position = m.position,
                                 .origin_m = m.origin_m,
                                 .bar_x = m.bar_x,
                                 .bar_z = m.bar_z,
                                 .tool_offset_m = m.tool_offset_m,
                                 .direction = m.pass == sim::mfb::Pass::Forward
                                                  ? calib::mfb::PassDirection::Forward
                                                  : calib::mfb::PassDirection::Backward,
                                 .temperature_K = probed.temperature_C[i] + kZeroCelsius_K});
  }
  return plan;
}

inline std::vector<calib::mfb::PassTouches> passes_of(std::size_t measurements,
                                                      const sim::mfb::ProbedBar& probed) {
  std::vector<calib::mfb::PassTouches> passes(measurements);
  for (const sim::mfb::Touch& touch : probed.touches) {
    const auto& [feature, k, place_m, normal] = touch.target;
    passes[touch.measurement].push_back(
        {.target = {.feature = static_cast<calib::mfb::Feature>(feature.kind),
                    .index = feature.index,
                    .side = static_cast<calib::mfb::Side>(feature.side),
                    .k = k},
         .reading_m = touch.reading_m});
  }
  return passes;
}

inline calib::mfb::StepGauge gauge_of(const sim::mfb::ReversalRun& run,
                                      const sim::mfb::StepGauge& stated) {
  calib::mfb::StepGauge gauge{
      .name = stated.name,
      .u_m = stated.u_m,
      .u_per_m = stated.u_per_m,
      .expansion = calib::Expansivity{stated.alpha_per_K, stated.u_alpha_per_K},
      .temperature_K = stated.temperature_C + kZeroCelsius_K,
      .u_temperature_K = stated.u_temperature_K,
      .origin_m = run.gauge_origin_m,
      .tool_offset_m = run.plan.front().tool_offset_m,
      .u_rotation_rad = stated.u_rotation_rad,
      .u_alignment_rad = stated.u_alignment_rad};
  for (std::size_t i = 0; i < run.distances_m.size(); ++i) {
    gauge.faces.push_back({run.distances_m[i], run.readings_m[i]});
  }
  return gauge;
}

}  // namespace abbe::tests::mfb

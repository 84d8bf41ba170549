#include "abbe/methods/otf/inputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>

#include "abbe/calib/otf/observe/orientation.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "abbe/calib/otf/plan/plan_observable.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "abbe/calib/otf/solve/backlash.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/config/stretched.hpp"
#include "abbe/pipeline/environment_use.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

// The alignment needs 20 points of standstill at either end of a run
// (calib::otf::Options::standstill_samples).
constexpr double kStandstillPoints = 20.0;

calib::Vector3 direction_of(TrackerVertical vertical) {
  const auto number = static_cast<int>(vertical);
  return (number % 2 == 0 ? 1.0 : -1.0) * calib::Vector3::Unit(number / 2);
}

calib::otf::OrientationEvidence orientation_evidence(const MachineConfig& machine,
                                                     const GateConfig& gate) {
  calib::otf::OrientationEvidence evidence;
  if (machine.tracker_vertical) evidence.up = direction_of(*machine.tracker_vertical);
  if (const auto& p = machine.tracker_position_m) evidence.tracker_m = calib::Vector3(p->data());
  evidence.accepted = gate.accepts(calib::otf::kPathOrientation);
  return evidence;
}

}  // namespace

calib::otf::Noise otf_noise(const MachineConfig& machine) {
  return {.sigma_range_m = machine.sigma_range_m,
          .sigma_angle_rad = machine.sigma_angle_rad,
          .u_range_offset_m = machine.u_range_offset_m};
}

calib::otf::Path otf_path(std::span<const AxisPosition> path_m) {
  calib::otf::Path path;
  path.vertices_m.reserve(path_m.size());
  for (const AxisPosition& q : path_m) path.vertices_m.emplace_back(q[0], q[1], q[2]);
  return path;
}

namespace {

/// Checks that a run along the path determines the tables.
calib::Result<void> determines_tables(const calib::otf::Path& path,
                                      const calib::otf::Machine& machine, calib::otf::Mode mode,
                                      calib::TravelDependence backlash) {
  if (mode == calib::otf::Mode::OnTheFly)
    return calib::otf::check_observable(path, machine, backlash);
  if (backlash == calib::TravelDependence::None) return {};
  const auto first =
      calib::otf::first_with_known_travel(calib::otf::travel_along(path.vertices_m, mode));
  ABBE_TRY(first);
  return {};
}

}  // namespace

Result<void> check_otf_path(std::span<const AxisPosition> path_m, const MachineConfig& machine,
                            calib::otf::Mode mode, calib::TravelDependence backlash) {
  ABBE_TRY(require_target(machine));
  const auto known = otf_machine(machine);
  ABBE_TRY(known);
  const calib::otf::Path path = otf_path(path_m);
  auto valid = calib::otf::check(path, known->nodes);
  if (valid) valid = determines_tables(path, *known, mode, backlash);
  if (!valid) return fail(ErrorCode::BadInput, "calibrate otf: " + valid.error().text);
  return {};
}

std::vector<calib::otf::TrackerObservation> otf_observations(std::span<const RunPoint> points) {
  std::vector<calib::otf::TrackerObservation> out;
  out.reserve(points.size());
  for (const RunPoint& p : points) {
    out.push_back(
        {.time_s =
             std::chrono::duration<double>(p.device_time - points.front().device_time).count(),
         .p_tracker_m = {p.p_tracker_m[0], p.p_tracker_m[1], p.p_tracker_m[2]},
         .valid = p.usable});
  }
  return out;
}

calib::otf::Options otf_options(std::span<const calib::otf::TrackerObservation> points,
                                const Config& config) {
  calib::otf::Options options;
  options.mode = calib_of(config.otf.mode);
  options.standstill.u_repeatability_m = config.otf.u_repeatability_m;
  options.estimator = calib_of(config.otf.estimator);
  options.backlash = calib_of(config.otf.backlash);
  options.nests = nest_options(config.otf);
  options.smoothness = smoothness_options(config.otf);
  options.segment_samples = calib::otf::suitable_segment_samples(points);
  options.held_out_folds =
      static_cast<std::size_t>(std::lround(1.0 / config.gate.holdout_fraction));
  options.orientation = orientation_evidence(config.machine, config.gate);
  return options;
}

calib::GateLimits gate_limits(const GateConfig& gate) {
  return {.max_error_m = gate.max_error_m,
          .max_gradient = gate.max_gradient,
          .accept_smaller_volume = gate.accepts(calib::kSmallerVolume),
          .accept_scale_change = gate.accepts(calib::kScaleChange)};
}

AcquisitionOptions acquisition_options(const Config& config) {
  AcquisitionOptions options;
  options.arrival_time_out = stretched(options.arrival_time_out, config.daemon.speed);
  options.environment = environment_use(config);
  options.reading_tolerance_m = config.gate.path_tolerance_m;
  const auto tracker = tracker_source(config);
  if (!tracker) return options;
  const std::chrono::duration<double> period{1.0 / tracker->point_rate_hz};

  const auto holding = [&period](double points) {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(points * period);
  };

  options.stand_before = std::max(options.stand_before, holding(kStandstillPoints));
  options.keep_before = std::max(options.keep_before, holding(2.0 * kStandstillPoints));
  options.keep_after = std::max(options.keep_after, holding(2.0 * kStandstillPoints));
  options.stand_after =
      std::max(options.stand_after, options.keep_after + holding(kStandstillPoints));

  return options;
}

}  // namespace abbe::daemon

#pragma once
/// Converts the daemon's configuration and recorded points to the input types of calib's on-the-fly
/// method. Pure; allocates.

#include <span>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/calib/otf/run/run.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/otf/acquisition.hpp"

namespace abbe::daemon {

[[nodiscard]] calib::otf::Noise otf_noise(const MachineConfig& machine);
[[nodiscard]] calib::otf::Path otf_path(std::span<const AxisPosition> path_m);
/// Checks a path before the machine follows it. BadInput if no run along the path could be
/// identified: too few vertices, vertices on one line or outside the travel, no [target], or in
/// mode on-the-fly tables that the path does not determine (named in the text). If backlash is
/// identified, the legs before the first motion of an axis do not count, and a path on which an
/// axis does not move is BadInput.
[[nodiscard]] Result<void> check_otf_path(
    std::span<const AxisPosition> path_m, const MachineConfig& machine,
    calib::otf::Mode mode = calib::otf::Mode::OnTheFly,
    calib::TravelDependence backlash = calib::TravelDependence::None);
/// Converts the points. Times are those of the tracker's clock, relative to the first point.
[[nodiscard]] std::vector<calib::otf::TrackerObservation> otf_observations(
    std::span<const RunPoint> points);
/// Options of fit and judgement for these points, from [otf] and [gate]. The daemon, a replay and
/// an identification from files use the same options. Of the evidence about the orientation of the
/// path only the configured part is set; the caller sets orientation.scales_agree.
[[nodiscard]] calib::otf::Options otf_options(
    std::span<const calib::otf::TrackerObservation> points, const Config& config);
[[nodiscard]] calib::GateLimits gate_limits(const GateConfig& gate);

/// Options of an acquisition. At the configured point rate of the tracker, each required standstill
/// is long enough for the number of points that the alignment needs.
[[nodiscard]] AcquisitionOptions acquisition_options(const Config& config);

}  // namespace abbe::daemon

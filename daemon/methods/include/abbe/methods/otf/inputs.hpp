#pragma once
/// The daemon's configuration and recorded points as the input types of the on-the-fly method: the
/// copy that is all the daemon knows of them. Pure; allocates.

#include <span>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/calib/gate.hpp"
#include "abbe/calib/otf/run.hpp"
#include "abbe/config/calibration_machine.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/otf/acquisition.hpp"

namespace abbe::daemon {

[[nodiscard]] calib::otf::Noise otf_noise(const MachineConfig& machine);
[[nodiscard]] calib::otf::Path otf_path(std::span<const AxisPosition> path_m);
/// BadInput when no run along the path could be identified: too few vertices, on a line, outside
/// the travel; no [target].
[[nodiscard]] Result<void> check_otf_path(std::span<const AxisPosition> path_m,
                                          const MachineConfig& machine);
/// Time is the tracker's own clock from the first point on.
[[nodiscard]] std::vector<calib::otf::TrackerObservation> otf_observations(
    std::span<const RunPoint> points);
/// How these points are fitted and judged under [gate]: the same for the daemon, a replay and
/// files. Of the evidence of the path's orientation what is configured; whether scales agreed is
/// the caller's to add.
[[nodiscard]] calib::otf::Options otf_options(
    std::span<const calib::otf::TrackerObservation> points, const MachineConfig& machine,
    const GateConfig& gate);
[[nodiscard]] calib::GateLimits gate_limits(const GateConfig& gate);

/// Standstill is judged over enough points at the tracker's rate.
[[nodiscard]] AcquisitionOptions acquisition_options(const Config& config);

}  // namespace abbe::daemon

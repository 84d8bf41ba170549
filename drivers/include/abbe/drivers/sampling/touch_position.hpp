#pragma once
/// Axis positions at the contact, with uncertainty. The contact is at the edge minus the probe's
/// delay; positions are interpolated between the scans before and after it. Pure; real time.
///
/// Contributions to the uncertainty of an axis that moves at the velocity v:
///   v times the uncertainty of the instant:
///     jitter and calibration of the delay: normal
///     period of the clock: triangular, because edge and scan are both counted
///     interval of the edge: rectangular
///   interpolation
///   resolution of the scale: rectangular
/// The 95 % interval is that of the convolution of the edge's rectangle with a normal distribution
/// of all other contributions.

#include "abbe/drivers/sampling/edge_confirmation.hpp"
#include "abbe/drivers/sampling/probe_options.hpp"
#include "abbe/drivers/sampling/scan_history.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

/// Returns a touch with all members set except its number. If there are no scans on one side of the
/// contact, it has TouchFlag::NoPosition, and every axis is missing and NaN.
[[nodiscard]] protocol::ProbeTrigger locate_touch(const EdgeInterval& edge,
                                                  const ScanHistory& scans,
                                                  const TouchOptions& options) ABBE_RT;

}  // namespace abbe::drivers

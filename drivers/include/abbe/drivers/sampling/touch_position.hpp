#pragma once
/// Where the axes were at the contact: at the edge less the probe's delay, by interpolation between
/// the enclosing scans, with its uncertainty. Pure; real time.
///
/// Uncertainty of an axis that moves at v: v times that of the instant (jitter and calibration of
/// the delay, normal; the clock's period, triangular because edge and scan are both counted; the
/// edge's interval, rectangular), the interpolation, and the resolution of the scale (rectangular).
/// The 95 % interval is that of the rectangle of the edge's interval convolved with all the rest
/// taken as normal.

#include "abbe/drivers/sampling/edge_confirmation.hpp"
#include "abbe/drivers/sampling/probe_options.hpp"
#include "abbe/drivers/sampling/scan_history.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

/// All but the number of the touch. Without scans around it: TouchFlag::NoPosition, every axis
/// missing and NaN.
[[nodiscard]] protocol::ProbeTrigger locate_touch(const EdgeInterval& edge,
                                                  const ScanHistory& scans,
                                                  const TouchOptions& options) ABBE_RT;

}  // namespace abbe::drivers

#pragma once
/// The figures of the residuals of a run along a path that a model document contains. Pure.

#include <span>

#include "abbe/methods/otf/identification.hpp"
#include "abbe/model/run_figures.hpp"

namespace abbe::daemon {

/// Adds the residuals by leg and over time, the held-out observations by cell of `volume`, the
/// duration and the feed. Several runs follow each other. `stands`: the parts are positions instead
/// of legs, and there is no feed.
void add_run_residuals(RunFigures& figures, std::span<const RunResiduals> runs,
                       const calib::ValidityVolume& volume, bool stands);

}  // namespace abbe::daemon

#pragma once
/// What a model document keeps of the residuals of a run along a path. Pure.

#include <span>

#include "abbe/methods/otf/identification.hpp"
#include "abbe/model/run_figures.hpp"

namespace abbe::daemon {

/// Adds residuals by leg and over time, held-out observations by cell of `volume`, duration and
/// feed. Several runs follow each other. `stands`: legs are positions, and there is no feed.
void add_run_residuals(RunFigures& figures, std::span<const RunResiduals> runs,
                       const calib::ValidityVolume& volume, bool stands);

}  // namespace abbe::daemon

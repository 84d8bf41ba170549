#pragma once
/// What a model document keeps of an identification with a Multi-Feature Bar, for the report. Pure.

#include "abbe/methods/mfb/identification.hpp"
#include "abbe/model/run_figures.hpp"

namespace abbe::daemon {

/// Verdict, residuals at the calibrated points by measurement, the bar in its positions, and as
/// tables: chi-square with its likely cause, the parts of the uncertainty, the Monte Carlo check,
/// the bar and its corrections, the positions beside the plan.
[[nodiscard]] RunFigures mfb_figures(const MfbCandidate& candidate);

}  // namespace abbe::daemon

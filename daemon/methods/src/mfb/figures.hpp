#pragma once
/// The figures of an identification with a Multi-Feature Bar that a model document contains, for
/// the report. Pure.

#include "abbe/methods/mfb/identification.hpp"
#include "abbe/model/run_figures.hpp"

namespace abbe::daemon {

/// Verdict, residuals at the calibrated points by measurement, and the bar in its positions.
/// Tables: chi-square with its likely cause, the parts of the uncertainty, the Monte Carlo check,
/// the bar and its corrections, the measured positions compared with the plan.
[[nodiscard]] RunFigures mfb_figures(const MfbCandidate& candidate);

}  // namespace abbe::daemon

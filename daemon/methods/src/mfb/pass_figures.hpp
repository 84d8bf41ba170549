#pragma once
/// Figures of the passes along a Multi-Feature Bar, for the report.

#include "abbe/methods/mfb/identification.hpp"
#include "abbe/report/html_report.hpp"

namespace abbe::daemon {

/// Adds the residuals of each measurement along the bar, and the corrections of its calibration.
void add_residuals_along_bar(HtmlReport& page, const MfbCandidate& candidate);

/// Adds a drawing of the bar in all its positions.
void add_positions_of_bar(HtmlReport& page, const MfbCandidate& candidate);

/// Adds the drift of each pair of passes; nothing without pairs.
void add_drift_of_passes(HtmlReport& page, const MfbCandidate& candidate);

/// Adds the excluded touches.
void add_touches_set_aside(HtmlReport& page, const MfbCandidate& candidate);

}  // namespace abbe::daemon

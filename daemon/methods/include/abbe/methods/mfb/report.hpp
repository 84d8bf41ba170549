#pragma once
/// The HTML page that explains the result of a calibration with a Multi-Feature Bar to people.
/// Pure.

#include <string>

#include "abbe/methods/mfb/identification.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// A self-contained HTML page: verdict, chi-square, the 21 errors with their uncertainties and
/// budgets, residuals along the bar, the bar in its positions, drift, excluded touches,
/// volume, origin.
[[nodiscard]] std::string mfb_report(const ModelDocument& document, const MfbCandidate& candidate);

}  // namespace abbe::daemon

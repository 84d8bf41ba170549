#pragma once
/// Figures of the residuals of a run on the fly or with standstills, for its report.

#include <span>

#include "abbe/methods/otf/report.hpp"
#include "abbe/report/model_figures.hpp"

namespace abbe::daemon {

/// Adds the figures before and after, histograms, the distribution in units of the standard
/// uncertainties, and the residuals along the path.
void add_residual_figures(HtmlReport& page, const ModelDocument& document,
                          std::span<const RunResiduals> runs);

/// The observations that were held out.
[[nodiscard]] std::vector<LeftError> left_errors(std::span<const RunResiduals> runs);

}  // namespace abbe::daemon

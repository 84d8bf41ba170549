#pragma once
/// The HTML page that explains the result of an on-the-fly calibration to people. Pure.

#include <span>
#include <string>

#include "abbe/calib/gate.hpp"
#include "abbe/methods/otf/identification.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/report/html_report.hpp"

namespace abbe::daemon {

/// A self-contained HTML page: verdict, residuals, tables and volume with their uncertainties,
/// origin. `runs`: in the order in which they were identified.
[[nodiscard]] std::string otf_report(const ModelDocument& document,
                                     std::span<const RunResiduals> runs,
                                     const calib::Verdict& verdict);

/// Adds charts of the error tables of a model with their bands, and a table of its squareness.
void add_error_tables(HtmlReport& page, const calib::VolumetricModel& model);

}  // namespace abbe::daemon

#pragma once
/// The HTML report of an on-the-fly calibration: the verdict, the residuals, the error tables with
/// their uncertainty. Pure.

#include <string>

#include "abbe/calib/gate.hpp"
#include "abbe/calib/otf/solve.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/report/html_report.hpp"

namespace abbe::daemon {

/// Content of report.html, self-contained. `document`, `residuals` and `verdict` are of one
/// solution.
[[nodiscard]] std::string otf_report(const ModelDocument& document,
                                     const calib::otf::Residuals& residuals,
                                     const calib::Verdict& verdict);

/// Adds charts of the error tables with their uncertainty, and the squareness errors.
void add_error_tables(HtmlReport& page, const calib::VolumetricModel& model);

}  // namespace abbe::daemon

#pragma once
/// The HTML report of an on-the-fly calibration: the verdict, the residuals, the error tables with
/// their uncertainty. Pure.

#include <string>

#include "abbe/calib/gate.hpp"
#include "abbe/calib/otf/solve.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// Content of report.html, self-contained. `document`, `residuals` and `verdict` are of one
/// solution.
[[nodiscard]] std::string otf_report(const ModelDocument& document,
                                     const calib::otf::Residuals& residuals,
                                     const calib::Verdict& verdict);

}  // namespace abbe::daemon

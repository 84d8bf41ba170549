#pragma once
/// What a metrologist looks at first after an on-the-fly calibration: the verdict, what remains,
/// the error tables with their uncertainty. Pure.

#include <string>

#include "abbe/calib/gate.hpp"
#include "abbe/calib/otf/solve.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// report.html, self-contained. `document` is the one made from `solution`.
[[nodiscard]] std::string otf_report(const ModelDocument& document,
                                     const calib::otf::Residuals& residuals,
                                     const calib::Verdict& verdict);

}  // namespace abbe::daemon

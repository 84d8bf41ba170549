#pragma once
/// The HTML report of a calibration with a ball array: the verdict, the rotation that the method
/// does not determine, the residuals at the balls, the coefficients. Pure.

#include <string>

#include "abbe/calib/evemu/judge.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// Content of report.html, self-contained. `document`: made from `solution`.
[[nodiscard]] std::string evemu_report(const ModelDocument& document,
                                       const calib::evemu::Observations& observations,
                                       const calib::evemu::Solution& solution,
                                       const calib::Verdict& verdict);

}  // namespace abbe::daemon

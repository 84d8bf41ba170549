#pragma once
/// What a metrologist looks at first after a calibration with a ball array: the verdict, what the
/// method cannot see, what remains at the balls, the coefficients. Pure.

#include <string>

#include "abbe/calib/evemu/judge.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// report.html, self-contained. `document` is the one made from `solution`.
[[nodiscard]] std::string evemu_report(const ModelDocument& document,
                                       const calib::evemu::Observations& observations,
                                       const calib::evemu::Solution& solution,
                                       const calib::Verdict& verdict);

}  // namespace abbe::daemon

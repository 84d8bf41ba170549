#pragma once
/// Finds the likely cause of a chi-square above its limit. The alternatives are tested one at a
/// time, with additional unknowns in the simultaneous adjustment: a drift of every pass; a wrong
/// calibration of, or dirt in, one hole; or one measurement is left out. The alternative with the
/// smallest chi-square per degree of freedom is the likely cause if it removes most of the excess.

#include "abbe/calib/mfb/solve/identify.hpp"

namespace abbe::calib::mfb {

[[nodiscard]] LikelyCause likely_cause(const Observations&, const Solution&, const SolveOptions&);

}  // namespace abbe::calib::mfb

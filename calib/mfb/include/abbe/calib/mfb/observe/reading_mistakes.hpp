#pragma once
/// Searches typical mistakes in the readings of a calibration with a bar, for the message if the
/// errors cannot be identified: axes swapped or reversed, a wrong unit, tool offsets with the
/// opposite sign, positions of the tip instead of scale readings, the touches of another
/// measurement. Each mistake is corrected on trial. A correction explains the readings if it puts
/// every touch to within 20 mm of its planned place; this is more than the largest permitted
/// difference between bar and plan. Pure.

#include <span>
#include <string>

#include "abbe/calib/mfb/run/measurement.hpp"

namespace abbe::calib::mfb {

/// Text such as "; the readings fit the plan with X and Y swapped". Empty if the readings fit as
/// they are, or if no correction explains them. Bar and plan must be valid; one PassTouches per
/// measurement.
[[nodiscard]] std::string corrections_to_plan(const Bar&, const Plan&,
                                              std::span<const PassTouches>);

}  // namespace abbe::calib::mfb

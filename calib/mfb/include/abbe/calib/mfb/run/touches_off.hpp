#pragma once
/// Finds single touches that do not fit the plan and the other touches of their measurement: a row
/// that holds 0, 0, 0 for a touch that was not made, or a wrong digit. Each measurement is tested
/// by itself with fit::points_off(). The rigid motion from the planned tip centres to readings plus
/// tool offset describes how the bar lies on the machine. Lengths in m. Pure; allocates.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/mfb/run/bar.hpp"
#include "abbe/calib/mfb/run/measurement.hpp"

namespace abbe::calib::mfb {

struct TouchOff {
  std::size_t pass = 0;   ///< index of the measurement in the plan
  std::size_t touch = 0;  ///< index in the order of the pass
  double distance_m = 0.0;
  double rms_others_m = 0.0;  ///< rms distance of the other touches of the measurement
};

/// `passes`: one per measurement of the plan.
[[nodiscard]] std::vector<TouchOff> touches_off(const Bar&, const Plan&,
                                                std::span<const PassTouches> passes);

}  // namespace abbe::calib::mfb

#pragma once
/// Single touches that are not where the plan and all other touches of their measurement place
/// them:
/// a row that holds 0, 0, 0 for a touch that was not made, or a wrong digit. Tested measurement by
/// measurement with fit::points_off(): a rigid motion, which is how the bar lies on the machine,
/// from the planned tip centres to readings plus tool offset. Lengths in m. Pure; allocates.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/mfb/run/bar.hpp"
#include "abbe/calib/mfb/run/measurement.hpp"

namespace abbe::calib::mfb {

struct TouchOff {
  std::size_t pass = 0;   ///< measurement of the plan
  std::size_t touch = 0;  ///< in the order of the pass
  double distance_m = 0.0;
  double rms_others_m = 0.0;  ///< of the other touches of the measurement
};

/// `passes`: one per measurement of the plan.
[[nodiscard]] std::vector<TouchOff> touches_off(const Bar&, const Plan&,
                                                std::span<const PassTouches> passes);

}  // namespace abbe::calib::mfb

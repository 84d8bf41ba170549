#pragma once
/// Touches of a Multi-Feature Bar and of a step gauge on a measuring machine that moves to
/// commanded positions, with the path of the tip to each touch. Places are centres of the tip in
/// machine axes, m. Pure.
///
/// "Up" is the direction of bar_z in the first measurement; all passes of a calibration probe from
/// this side. In a reversed pass bar_z points down. The z of every place of the pattern is
/// therefore counted along "up" and not along bar_z. Between two features the tip moves up to the
/// travel height, across, and down. Within a hole it moves through the axis, around a rod on a
/// square whose half side is the radius of the rod, that of the tip and the clearance. Other
/// objects on the table are not taken into account.

#include <cstddef>
#include <vector>

#include "abbe/calib/geometry/machine_touches.hpp"
#include "abbe/calib/mfb/identify/bar_calibration.hpp"
#include "abbe/calib/mfb/run/measurement.hpp"

namespace abbe::calib::mfb {

struct MachineTouchOptions {
  double clearance_m = 4e-3;       ///< distance from a surface before contact
  double travel_height_m = 40e-3;  ///< height above the axis of the bar or the faces of the gauge
};

/// The touches of one pass, with the bar at its planned place, in the order of the pass. `targets`:
/// the feature and k of each touch.
struct PassOnMachine {
  std::vector<Target> targets;
  MachineTouches made;
};
/// Plans one pass. `from_m`: present position of the tip. BadInput: a clearance or height that is
/// not positive, a clearance for which the tip does not fit into the holes, a height that the rods
/// of the bar reach, or a bar_z with another direction than in the first measurement.
[[nodiscard]] Result<PassOnMachine> pass_on_machine(const Bar&, const Plan&,
                                                    std::size_t measurement, const Vector3& from_m,
                                                    const MachineTouchOptions& = {});

/// Plans the touches of all faces of the gauge, `runs` times, every second run backward. The tip
/// moves in the direction of bar_x of `normal`: the gauge lies along the measured direction of the
/// bar (direction_of_bar()). BadInput as pass_on_machine(), or without runs or faces.
[[nodiscard]] Result<MachineTouches> gauge_on_machine(const StepGauge&, const Measurement& normal,
                                                      std::size_t runs, const Vector3& from_m,
                                                      const MachineTouchOptions& = {});

}  // namespace abbe::calib::mfb

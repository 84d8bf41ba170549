#pragma once
/// The places to which abbed may send a measuring machine. Every request that could become a motion
/// is checked here, as a whole, before any part of it is sent: the places on the way to a touch,
/// the touch itself and the way out. The volume is a box, so that a straight line between two
/// places in it stays in it. The additional motion of the command PtMeas is not checked: the
/// controller moves the tip by its approach, search and retract distances from the point that was
/// sent.

#include <array>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"
#include "abbe/drivers/ippdme/session.hpp"

namespace abbe::daemon {

/// One touch: the places that the tip passes on its way, in order, and then the point to touch.
struct TouchRequest {
  std::vector<drivers::ProbePoint> way;  ///< `touch` is false
  drivers::ProbePoint point;
};

/// A box in the coordinates of the measuring machine, m.
struct MotionVolume {
  std::array<double, 3> min_m{};
  std::array<double, 3> max_m{};
  std::array<std::string, 3> limited_by{};  ///< the configuration key of each axis, for messages
};

/// The volume that the table of the machine sets, else the travel of the axes X, Y and Z.
[[nodiscard]] MotionVolume motion_volume(const Config& config);

/// Refused if a coordinate is not finite or outside the volume, or if the normal of a touch is not
/// a unit vector. The text names the first such point, axis, value and limit, and the number of all
/// such points.
[[nodiscard]] Result<void> check_places(const MotionVolume& volume,
                                        std::span<const TouchRequest> touches,
                                        std::span<const drivers::ProbePoint> leave);

}  // namespace abbe::daemon

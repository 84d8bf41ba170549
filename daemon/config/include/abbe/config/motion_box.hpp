#pragma once

#include <array>

namespace abbe::daemon {

/// The volume in which the tip of a machine may move, in the coordinates of the machine, X, Y, Z.
struct MotionBox {
  std::array<double, 3> min_m{};
  std::array<double, 3> max_m{};
};

}  // namespace abbe::daemon

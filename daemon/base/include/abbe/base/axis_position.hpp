#pragma once
/// Where a machine of three axes stands. Pure data.

#include <array>

namespace abbe::daemon {

/// Of X, Y and Z, in m: scale readings unless a name says otherwise.
using AxisPosition = std::array<double, 3>;

}  // namespace abbe::daemon

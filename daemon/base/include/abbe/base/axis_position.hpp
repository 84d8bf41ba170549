#pragma once
/// Position of a machine with three linear axes. Pure data.

#include <array>

namespace abbe::daemon {

/// X, Y and Z in m. The values are scale readings unless the name of a variable states otherwise.
using AxisPosition = std::array<double, 3>;

}  // namespace abbe::daemon

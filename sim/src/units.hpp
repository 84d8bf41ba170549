#pragma once

namespace abbe::sim {

// Files and messages use millimetres.
inline constexpr double kMmPerM = 1e3;
inline constexpr double kMPerMm = 1e-3;

}  // namespace abbe::sim

#pragma once

namespace abbe::sim::mfb {

inline constexpr double kUmPerM = 1e6;
inline constexpr double kReference_C = 20.0;  // reference temperature of lengths

}  // namespace abbe::sim::mfb

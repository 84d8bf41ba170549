#pragma once
/// Pure data.

#include <cstdint>

namespace abbe::drivers {

enum class AxisKind : std::uint8_t { Linear, Rotary };

}  // namespace abbe::drivers

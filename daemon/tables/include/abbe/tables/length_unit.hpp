#pragma once
/// The unit of lengths in a file of another program; an option or the file states it.

#include <optional>
#include <string_view>

namespace abbe::daemon {

/// Metres per "um", "mm", "m" or "inch"; nullopt for an unknown unit.
[[nodiscard]] constexpr std::optional<double> metres_per(std::string_view unit) {
  if (unit == "um") return 1e-6;
  if (unit == "mm") return 1e-3;
  if (unit == "m") return 1.0;
  if (unit == "inch") return 0.0254;
  return std::nullopt;
}

}  // namespace abbe::daemon

#pragma once
/// The uncertainty of the tracker's distances when they are not corrected for measured air. This is
/// so if [air] assumed_index is absent and either
/// - weather = "none": the controller is set to assumed_air(), or
/// - weather = "read": the refractive index set in the controller is not changed.
///
/// Pure.

#include <optional>
#include <string>

#include "abbe/config/config.hpp"

namespace abbe::daemon {

struct AssumedAir {
  double temperature_K = 293.15, pressure_Pa = 101'325.0, relative_humidity = 0.5;
};
/// The air to which the controller is set with weather = "none": 20 C, 1013.25 hPa, 50 %.
[[nodiscard]] inline AssumedAir assumed_air() noexcept {
  return {};
}

/// Relative standard uncertainty common to all distances that are not corrected for measured air,
/// for the range of air on shop floors: 1.05e-5.
[[nodiscard]] double u_of_unmeasured_air() noexcept;

/// Text for verdict and status. It states for which air the distances are corrected, and the
/// uncertainty `u_scale` that the model assumes because of this. nullopt if the distances are
/// corrected for measured air.
[[nodiscard]] std::optional<std::string> unmeasured_air_text(const Config& config, double u_scale);

}  // namespace abbe::daemon

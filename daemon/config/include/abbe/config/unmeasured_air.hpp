#pragma once
/// The case that the tracker's distances are not corrected for measured air: there is no [air]
/// assumed_index, and
/// - weather = "none": the controller is set to assumed_air(), or
/// - weather = "read": the refractive index set in the controller is not changed.
///
/// Pure.

#include <optional>
#include <string>

#include "abbe/calib/environment/refractive_index.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// The air to which the controller is set with weather = "none": 20 C, 1013.25 hPa, 50 %.
[[nodiscard]] calib::Air assumed_air() noexcept;

/// Relative standard uncertainty of all distances in this case, for the range of air on shop
/// floors: 1.05e-5.
[[nodiscard]] double u_of_unmeasured_air() noexcept;

/// Text for verdict and status: the assumed air, and `u_scale` of the model. nullopt if the air is
/// measured.
[[nodiscard]] std::optional<std::string> unmeasured_air_text(const Config& config, double u_scale);

}  // namespace abbe::daemon

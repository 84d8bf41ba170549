#pragma once
/// A tracker whose distances are corrected for air that no instrument measured: weather = "none",
/// where the controller is set to assumed_air(), or weather = "read", where its index stays as it
/// was set last; and no [air] assumed_index. Pure.

#include <optional>
#include <string>

#include "abbe/calib/environment/refractive_index.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// What the controller is set to with weather = "none": 20 C, 1013.25 hPa, 50 %.
[[nodiscard]] calib::Air assumed_air() noexcept;

/// Relative standard uncertainty of all distances then, against the air of a shop floor: 1.05e-5.
[[nodiscard]] double u_of_unmeasured_air() noexcept;

[[nodiscard]] bool air_is_unmeasured(const Config& config) noexcept;

/// For verdict and status: what was corrected for, and `u_scale` as it is in the model. None: the
/// air is measured.
[[nodiscard]] std::optional<std::string> unmeasured_air_text(const Config& config, double u_scale);

}  // namespace abbe::daemon

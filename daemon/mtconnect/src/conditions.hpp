#pragma once
/// The conditions in the answer to "status". They throw as observations_of() does.

#include "abbe/mtconnect/observations.hpp"

namespace abbe::mtconnect {

/// COMMUNICATIONS: one native code for each device, its stream name.
[[nodiscard]] Condition device_condition(const nlohmann::json& status);
/// SYSTEM: the parts of abbed that are not devices, and a machine that waits for its release.
[[nodiscard]] Condition system_condition(const nlohmann::json& status);
/// DATA_RANGE: the active model and the verdict of the last calibration.
[[nodiscard]] Condition model_condition(const nlohmann::json& status);

}  // namespace abbe::mtconnect

#pragma once

#include <nlohmann/json.hpp>

#include "abbe/base/error.hpp"

namespace abbe::web {

/// The request to abbed for a calibration that a page asks for. A file is {"file": NAME, "text":
/// CONTENT}. `body`:
///
///     {"method": "otf", "path": FILE, "mode": "on-the-fly" | "standstill"}
///     {"method": "evemu", "calibrator": FILE, "reference": FILE, "u_reference_um": NUMBER}
///     {"method": "mfb", "bar": FILE, "plan": FILE}
///
/// "mode", "reference" and "u_reference_um" may be missing. BadInput names file, line and field;
/// Usage for an unknown method. Throws nlohmann::json::exception for a member that is missing or of
/// the wrong type.
[[nodiscard]] daemon::Result<nlohmann::json> calibration_task(const nlohmann::json& body);

}  // namespace abbe::web

#pragma once

#include <nlohmann/json.hpp>

namespace abbe::web {

/// The bars of the plan in `request`, a calibration with a Multi-Feature Bar:
/// [{"measurement": NAME, "holes_mm": [[x, y, z] ...]}], planned places of the tip in machine
/// coordinates. Empty for another request.
[[nodiscard]] nlohmann::json bars_of(const nlohmann::json& request);

}  // namespace abbe::web

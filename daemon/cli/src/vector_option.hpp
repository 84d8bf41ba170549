#pragma once
/// Options of three numbers, "x,y,z" in mm.

#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/volumetric_model.hpp"

namespace abbe::daemon {

/// In m. Usage if it is anything but three finite numbers; `option` names it in the error.
[[nodiscard]] Result<calib::Vector3> parse_mm(const std::string& option, const std::string& text);

/// --tool, or the model's own if `text` is empty. DataInsufficient if the model does not hold for
/// it.
[[nodiscard]] Result<calib::Vector3> tool_of(const std::string& text,
                                             const calib::VolumetricModel& model);

}  // namespace abbe::daemon

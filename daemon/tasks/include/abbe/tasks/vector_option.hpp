#pragma once
/// Reads options of three numbers, "x,y,z" in mm.

#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::daemon {

/// Returns the vector in m. Error Usage unless `text` is three finite numbers; `option` is the name
/// of the option in the message.
[[nodiscard]] Result<calib::Vector3> parse_mm(const std::string& option, const std::string& text);

/// The tool offset given by --tool-mm (`text`), or that of the model if `text` is empty.
/// DataInsufficient if the model is not valid for this tool offset.
[[nodiscard]] Result<calib::Vector3> tool_of(const std::string& text,
                                             const calib::VolumetricModel& model);

}  // namespace abbe::daemon

#pragma once
/// Reads the option --direction "+,-,0": the direction in which X, Y and Z last moved.

#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::daemon {

/// Error Usage unless `text` consists of three of "+", "-", "0", separated by commas. An empty text
/// means that all directions are unknown.
[[nodiscard]] Result<calib::AxisTravel> parse_direction(const std::string& text);

/// DataInsufficient if the model has no backlash, because its errors in one direction of travel are
/// then not known. `name`: name of the model, for the message.
[[nodiscard]] Result<void> require_travel(const calib::VolumetricModel&, const std::string& name);

}  // namespace abbe::daemon

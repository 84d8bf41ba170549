#pragma once
/// Option --direction "+,-,0": the direction in which X, Y and Z last moved.

#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::daemon {

/// Error Usage unless `text` is three of "+", "-", "0", separated by commas; empty: all unknown.
[[nodiscard]] Result<calib::AxisTravel> parse_direction(const std::string& text);

/// DataInsufficient for a model that has no backlash: what it is in one direction is not known.
/// `name` of the model is for the message.
[[nodiscard]] Result<void> require_travel(const calib::VolumetricModel&, const std::string& name);

}  // namespace abbe::daemon

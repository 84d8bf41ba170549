#pragma once
/// Reads the files of a control as the control does, and evaluates them. Shares no code with the
/// writers, so that an error of sign, unit or order in a written file is found.

#include <array>
#include <functional>
#include <span>
#include <string>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/exports/export_format.hpp"

namespace abbe::daemon {

/// Settings of the control that are not in its compensation files.
struct ControlSettings {
  std::array<std::string, 3> axis_names{"X", "Y", "Z"};
  int positive_moves = 1;
  std::string order_w_to_t = "XYZ";  ///< axes from workpiece to tool
  AxisPosition tool_m{};             ///< tool reference point to functional point
};

/// The correction that the control adds to a commanded position, in m. `direction`: +1 forward, -1
/// backward, 0 not known (the mean of both) for each axis. Thread-safe.
using ControlCorrection = std::function<AxisPosition(const AxisPosition& commanded_m,
                                                     const std::array<int, 3>& direction)>;

/// BadInput for text that the control would refuse, ignore or read differently than it appears
/// (LinuxCNC ends at a comment without a message); the text names file and line.
[[nodiscard]] Result<ControlCorrection> read_as_control(ExportFormat, std::span<const ExportFile>,
                                                        const ControlSettings&);

}  // namespace abbe::daemon

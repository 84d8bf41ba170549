#pragma once
/// Detects lengths in a file that are not in millimetres, for `identify otf`. Pure.

#include <filesystem>

#include "abbe/base/error.hpp"
#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

/// Compares the spread (rms distance from the centre) of the points with that of the path. BadInput
/// if it differs by the factor of a usual unit (m, um, inch; within a factor of 2); the text names
/// file and unit. The wrong file is the one whose spread differs more from `travel`. Machine
/// errors, dwells and missing parts of a run change a spread by much less.
/// `file`: name of the tracker's file in messages.
[[nodiscard]] Result<void> check_length_unit(const std::filesystem::path& file,
                                             const TrackerFile& tracker, const PathFile& path,
                                             const calib::MachineNodes& travel);

}  // namespace abbe::daemon

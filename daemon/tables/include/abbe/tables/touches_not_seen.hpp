#pragma once

#include <string>

#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/tables/evemu_files.hpp"

namespace abbe::daemon {

/// Finds the first position of the array whose touches do not determine the pose of the calibrator.
/// Returns ":42", the line of its first touch in the file; empty if there is no such position.
[[nodiscard]] std::string line_not_seen(const TouchesFile& file,
                                        const calib::evemu::Calibrator& calibrator,
                                        const calib::evemu::ObserveOptions& options);

}  // namespace abbe::daemon

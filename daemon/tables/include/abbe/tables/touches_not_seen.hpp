#pragma once

#include <string>

#include "abbe/calib/evemu/observe.hpp"
#include "abbe/tables/evemu_files.hpp"

namespace abbe::daemon {

/// Finds the first position whose touches do not determine the pose of the calibrator, and returns
/// the first line of that position as ":42". Empty if all positions are valid.
[[nodiscard]] std::string line_not_seen(const TouchesFile& file,
                                        const calib::evemu::Calibrator& calibrator,
                                        const calib::evemu::ObserveOptions& options);

}  // namespace abbe::daemon

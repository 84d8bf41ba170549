#pragma once

#include <string>

#include "abbe/calib/evemu/observe.hpp"
#include "abbe/tables/evemu_files.hpp"

namespace abbe::daemon {

/// ":42", the line where the touches of the first position begin in which the calibrator is not
/// seen; empty: it is seen in each.
[[nodiscard]] std::string line_not_seen(const TouchesFile& file,
                                        const calib::evemu::Calibrator& calibrator,
                                        const calib::evemu::ObserveOptions& options);

}  // namespace abbe::daemon

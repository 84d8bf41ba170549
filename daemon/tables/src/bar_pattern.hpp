#pragma once
/// Reads [pattern] of bar.toml.

#include "abbe/base/faults.hpp"
#include "abbe/calib/mfb/run/bar.hpp"
#include "abbe/settings/section.hpp"

namespace abbe::daemon {

/// Reads and checks [pattern]. `faults`: the list to which `root` adds. Returns true if the places
/// of the holes are valid.
[[nodiscard]] bool read_bar_pattern(Section& root, calib::mfb::TouchPattern& out,
                                    const Faults& faults);

}  // namespace abbe::daemon

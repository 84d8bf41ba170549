#pragma once
/// The part of a Multi-Feature Bar in `abbe identify joint`.

#include "abbe/tables/parts_file.hpp"
#include "abbe/tasks/joint_input.hpp"

namespace abbe::daemon {

/// Reads the files of the bar, identifies and judges the bar alone as `identify mfb` does, which
/// also excludes wrong touches, and adds its part. `input` has the tables of the first run. Errors
/// without the name of the part: Io, BadInput with file and line, DataInsufficient.
[[nodiscard]] Result<void> add_bar(const IdentifyJointArguments&, const BarFiles&, JointInput&);

}  // namespace abbe::daemon

#pragma once
/// Adds a Multi-Feature Bar as a part of `abbe identify joint`.

#include "abbe/tables/parts_file.hpp"
#include "abbe/tasks/joint_input.hpp"

namespace abbe::daemon {

/// Reads the files of the bar, identifies and judges the bar alone as `identify mfb` does (which
/// also excludes wrong touches), and adds it as a part. Requires that `input` has the tables of the
/// first run. The texts of errors do not contain the name of the part: Io, BadInput with file and
/// line, DataInsufficient.
[[nodiscard]] Result<void> add_bar(const IdentifyJointArguments&, const BarFiles&, JointInput&);

}  // namespace abbe::daemon

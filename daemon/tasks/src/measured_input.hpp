#pragma once
/// --measured: measured.csv, or an .rtl file with what it does not state.

#include "abbe/tasks/compare_measured.hpp"

namespace abbe::daemon {

/// BadInput with what is missing for an .rtl file, or for options that measured.csv does not need.
[[nodiscard]] Result<MeasuredFile> read_measured(const MeasuredOptions& options);

}  // namespace abbe::daemon

#pragma once
/// Reads the file of the option --measured: measured.csv, or an .rtl file together with the options
/// that it needs.

#include "abbe/tasks/compare_measured.hpp"

namespace abbe::daemon {

/// Reads the file. BadInput names missing options for an .rtl file, or options that measured.csv
/// does not need.
[[nodiscard]] Result<MeasuredFile> read_measured(const MeasuredOptions& options);

}  // namespace abbe::daemon

#pragma once
/// `abbe model compare MODEL --measured FILE`: compares a model with directly measured error
/// motions.

#include <CLI/App.hpp>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/tasks/compare_measured.hpp"

namespace abbe::daemon {

/// Adds --measured and its options; returns --measured.
CLI::Option* add_measured_options(CLI::App& command, MeasuredOptions& options);

/// Prints the comparison as text or as one JSON object. Returns the exit code: 5 if a table
/// contradicts; 1 if no table could be tested, or if single values do not fit the others; else 0.
[[nodiscard]] Result<int> compare_with_measured(const calib::VolumetricModel& model,
                                                const MeasuredOptions& options, bool as_json);

}  // namespace abbe::daemon

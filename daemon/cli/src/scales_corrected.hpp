#pragma once
/// The option --scales-corrected.

#include <CLI/App.hpp>

#include "abbe/tasks/scales_corrected.hpp"

namespace abbe::daemon {

/// Adds the option --scales-corrected, which sets `corrected`.
CLI::Option* add_scales_corrected(CLI::App& command, bool& corrected);

}  // namespace abbe::daemon

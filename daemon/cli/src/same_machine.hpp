#pragma once
/// The option --other-machine.

#include <CLI/App.hpp>

#include "abbe/tasks/same_machine.hpp"

namespace abbe::daemon {

void add_other_machine_option(CLI::App& command, bool& other_machine);

}  // namespace abbe::daemon

#pragma once
/// The options --force and --why: a person uses a model although it must not be used.

#include <CLI/App.hpp>
#include <string>

#include "abbe/tasks/forced_use.hpp"

namespace abbe::daemon {

/// Adds the options. `what`: the action that is forced, for the help; `why`: help of --why.
/// --reason is another name of --why.
CLI::Option* add_force_options(CLI::App& command, ForceOption& options, const std::string& what,
                               const std::string& why);

}  // namespace abbe::daemon

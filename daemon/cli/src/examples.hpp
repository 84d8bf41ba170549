#pragma once
/// Example lines for the help of every command.

#include <CLI/App.hpp>

namespace abbe::daemon {

/// Puts an example before the footer of every subcommand, at all levels. Call it once, after all
/// subcommands are added.
void add_examples(CLI::App& app);

}  // namespace abbe::daemon

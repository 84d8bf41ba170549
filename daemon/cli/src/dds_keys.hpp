#pragma once
/// `abbe dds keys`: adds the subcommand to `parent`; see commands.hpp.

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

namespace abbe::daemon {

void add_dds_keys(CLI::App& parent, int& exit);

}  // namespace abbe::daemon

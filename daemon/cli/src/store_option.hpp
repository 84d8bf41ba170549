#pragma once
/// Finds the model store for a command: by --store, or by the configuration of the daemon.

#include <CLI/App.hpp>
#include <string>

#include "abbe/tasks/model_source.hpp"

namespace abbe::daemon {

/// Text for the help of commands: how a model can be named.
inline constexpr const char* kModelText =
    "model.json; or a model of the store: its id, the beginning of its id, or \"active\"";

void add_store_options(CLI::App& command, StoreOption& where);
/// Prints cautions_of() to stderr.
void print_cautions(const std::string& name, const FoundModel& model);

}  // namespace abbe::daemon

#pragma once
/// How a command finds the store of models: --store, or the configuration of the daemon it belongs
/// to.

#include <CLI/App.hpp>
#include <string>

#include "abbe/model/model_store.hpp"

namespace abbe::daemon {

struct StoreOption {
  std::string folder = "/var/lib/abbe/models";
  std::string config;
};

void add_store_options(CLI::App& command, StoreOption& where);
[[nodiscard]] Result<ModelStore> open_store(const StoreOption& where);

/// A file, or else a model of the store: its id, the beginning of one, "active". What looks like a
/// path is never looked up there.
[[nodiscard]] Result<ModelDocument> model_named(const std::string& name, const StoreOption& where);

}  // namespace abbe::daemon

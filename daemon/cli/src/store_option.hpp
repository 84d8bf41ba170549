#pragma once
/// How a command finds the model store: by --store, or by the configuration of the daemon.

#include <CLI/App.hpp>
#include <filesystem>
#include <string>

#include "abbe/model/model_store.hpp"

namespace abbe::daemon {

struct StoreOption {
  std::string folder = "/var/lib/abbe/models";
  std::string config;
};

void add_store_options(CLI::App& command, StoreOption& where);
/// Opens an existing store; creates nothing. Io if the folder does not exist, BadInput if the
/// folder is not a store.
[[nodiscard]] Result<ModelStore> open_store(const StoreOption& where);

/// The id that `name` stands for: "active" or the beginning of an id. Refused if `name` is "active"
/// and no model is active; the other errors are those of ModelStore::find().
[[nodiscard]] Result<std::string> id_named(const ModelStore& store, const std::string& name);
/// True if `name` is a path with a folder, has an extension, or is the name of an existing file.
[[nodiscard]] bool names_a_file(const std::string& name);

/// The file of a model: `name` itself if it is a path, else that in the store; empty if there is none.
[[nodiscard]] std::filesystem::path file_of_model(const std::string& name,
                                                  const StoreOption& where);

/// Reads a model file, or a model of the store by its id, the beginning of its id, or "active". A
/// name that looks like a path is never looked up in the store.
[[nodiscard]] Result<ModelDocument> model_named(const std::string& name, const StoreOption& where);

}  // namespace abbe::daemon

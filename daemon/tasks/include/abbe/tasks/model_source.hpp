#pragma once
/// Finds a model by its name: a file, or a model of a store.

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "abbe/model/model_use.hpp"

namespace abbe::daemon {

/// The folder of a store; or, if `config` is not empty, the abbed.toml that names the folder.
struct StoreOption {
  std::string folder = "/var/lib/abbe/models";
  std::string config;
};

/// Opens an existing store; creates nothing. Io if the folder does not exist, BadInput if the
/// folder is not a store.
[[nodiscard]] Result<ModelStore> open_store(const StoreOption& where);

/// The id that `name` stands for: "active" or the beginning of an id. Refused if `name` is "active"
/// and no model is active; the other errors are those of ModelStore::find().
[[nodiscard]] Result<std::string> id_named(const ModelStore& store, const std::string& name);
/// True if `name` is a path with a folder, has an extension, or is the name of an existing file.
[[nodiscard]] bool names_a_file(const std::string& name);

/// machine_hash() of the abbed.toml given with option -c; nullopt without -c.
[[nodiscard]] Result<std::optional<std::string>> machine_hash_of(const StoreOption& where);

/// The file of a model: `name` itself if it is a path, else the file in the store. Empty if there
/// is none.
[[nodiscard]] std::filesystem::path file_of_model(const std::string& name,
                                                  const StoreOption& where);

/// A model, with information about it from its store and the configuration.
struct FoundModel {
  ModelDocument document;
  std::vector<StoreEvent> events;           ///< empty for a file
  std::optional<std::string> machine_hash;  ///< machine_hash() of the abbed.toml given with -c
  std::string identity_doubt{};             ///< ModelInUse::identity_doubt; empty for a file

  [[nodiscard]] ModelInUse in_use(ModelPurpose purpose) const {
    return {document, events, machine_hash, purpose, identity_doubt};
  }
};

/// Reads a model file, or a model of the store by its id, the beginning of its id, or "active". A
/// name that looks like a path is never looked up in the store. The verdict is that of the store.
[[nodiscard]] Result<FoundModel> found_model(const std::string& name, const StoreOption& where);

/// Facts that a person must know who looks at the model. Empty for an accepted model without
/// restrictions.
[[nodiscard]] std::vector<std::string> cautions_of(const FoundModel& model);
/// Called with the name of a model, if it has cautions.
using ShowCautions = std::function<void(const std::string& name, const FoundModel& model)>;

}  // namespace abbe::daemon

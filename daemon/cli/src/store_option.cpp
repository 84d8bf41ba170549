#include "store_option.hpp"

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include "abbe/config/config.hpp"

namespace abbe::daemon {

void add_store_options(CLI::App& command, StoreOption& where) {
  auto* store =
      command.add_option("--store", where.folder, "folder of the store")->capture_default_str();
  command.add_option("-c,--config", where.config, "use the store of this abbed.toml")
      ->excludes(store);
}

Result<ModelStore> open_store(const StoreOption& where) {
  if (where.config.empty()) return ModelStore::open(where.folder);
  const auto config = load_config(where.config);
  if (!config) return tl::unexpected(config.error());
  return ModelStore::open(config->daemon.models_dir());
}

Result<ModelDocument> model_named(const std::string& name, const StoreOption& where) {
  std::error_code ignored;
  const std::filesystem::path file = name;
  if (file.has_parent_path() || file.has_extension() || std::filesystem::exists(file, ignored))
    return read_model(file);
  const auto store = open_store(where);
  if (!store) return tl::make_unexpected(store.error());
  const auto id = store->find(name);
  if (!id) return tl::make_unexpected(id.error());
  return store->load(*id);
}

}  // namespace abbe::daemon

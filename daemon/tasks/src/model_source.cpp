#include "abbe/tasks/model_source.hpp"

#include <fmt/format.h>

#include <system_error>

#include "abbe/config/config.hpp"
#include "abbe/model/machine_identity.hpp"
#include "abbe/model/stored_model.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

Result<fs::path> folder_of(const StoreOption& where) {
  if (where.config.empty()) return fs::path{where.folder};
  const auto config = load_config(where.config);
  ABBE_TRY(config);
  return config->daemon.models_dir();
}

}  // namespace

Result<ModelStore> open_store(const StoreOption& where) {
  const auto folder = folder_of(where);
  ABBE_TRY(folder);

  std::error_code seen;
  const bool exists = fs::is_directory(*folder, seen);
  if (!exists && (!seen || seen == std::errc::no_such_file_or_directory))
    return fail(ErrorCode::Io,
                fmt::format("{}: there is no such folder; give the folder of a model store with "
                            "--store, or the abbed.toml with -c",
                            folder->string()));
  if (exists && !fs::exists(*folder / "models", seen) && !seen)
    return fail(
        ErrorCode::BadInput,
        fmt::format("{}: is not a model store: it has no folder \"models\"; the store of "
                    "abbed is DATA_DIR/models, and `abbe identify ... --keep DIR` makes one",
                    folder->string()));
  return ModelStore::open(*folder);
}

Result<std::string> id_named(const ModelStore& store, const std::string& name) {
  if (name != "active") return store.find(name);

  const auto active = store.active_id();
  ABBE_TRY(active);
  if (*active) return **active;
  return fail(ErrorCode::Refused,
              "no model is active; `abbe model list` lists the models, `abbe model activate ID` "
              "makes one active");
}

bool names_a_file(const std::string& name) {
  std::error_code ignored;
  const fs::path file = name;
  return file.has_parent_path() || file.has_extension() || fs::exists(file, ignored);
}

std::filesystem::path file_of_model(const std::string& name, const StoreOption& where) {
  if (name.empty() || names_a_file(name)) return name;
  const auto store = open_store(where);
  const auto id = store ? id_named(*store, name) : Result<std::string>{};
  return store && id ? store->model_path(*id) : std::filesystem::path{};
}

Result<std::optional<std::string>> machine_hash_of(const StoreOption& where) {
  if (where.config.empty()) return std::nullopt;
  const auto config = load_config(where.config);
  ABBE_TRY(config);
  return machine_hash(*config);
}

Result<FoundModel> found_model(const std::string& name, const StoreOption& where) {
  auto machine = machine_hash_of(where);
  ABBE_TRY(machine);
  if (names_a_file(name)) {
    auto document = read_model(name);
    ABBE_TRY(document);
    return FoundModel{*std::move(document), {}, *std::move(machine)};
  }
  const auto store = open_store(where);
  ABBE_TRY(store);
  const auto id = id_named(*store, name);
  ABBE_TRY(id);
  auto stored = stored_model(*store, *id);
  ABBE_TRY(stored);
  return FoundModel{std::move(stored->document), std::move(stored->events), *std::move(machine),
                    identity_doubt(*store, *id, marks_of_this_computer())};
}

std::vector<std::string> cautions_of(const FoundModel& model) {
  auto all = obstacles_to_use(model.in_use(ModelPurpose::Look)).statements;
  if (state_of(model.document.verdict) == VerdictState::Accepted) all.erase(all.begin());
  return all;
}

}  // namespace abbe::daemon

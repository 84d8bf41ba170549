#include "abbe/daemon/old_recordings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string>

#include "abbe/daemon/model_store.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

/// Models name "NAME.mcap", or "NAME.mcap.part (4711 bytes)" while it still grew: NAME, of all of them.
Result<std::set<std::string>> named_by_models(const fs::path& folder) {
  std::set<std::string> names;
  std::error_code error;
  if (!fs::exists(folder, error) && !error) return names;
  const auto store = ModelStore::open(folder);
  if (!store) return tl::unexpected(store.error());
  const auto entries = store->list();
  if (!entries) return tl::unexpected(entries.error());
  for (const auto& entry : *entries) {
    const auto document = store->load(entry.id);
    if (!document) return tl::unexpected(document.error());
    for (const auto& input : document->inputs) names.insert(input.name.substr(0, input.name.find(".mcap")));
  }
  return names;
}

bool is_ours(const std::string& name) {
  return name.starts_with("abbe-") && (name.ends_with(".mcap") || name.ends_with(".mcap.part"));
}

}  // namespace

Result<std::vector<fs::path>> remove_old_recordings(const fs::path& directory, const fs::path& store,
                                                    fs::file_time_type until) {
  std::vector<fs::path> old;
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code ignored;
    const bool regular = entry->symlink_status(ignored).type() == fs::file_type::regular;
    if (regular && is_ours(entry->path().filename()) && entry->last_write_time(ignored) < until && !ignored)
      old.push_back(entry->path());
  }
  if (error) return fail(ErrorCode::Io, fmt::format("list {}: {}", directory.string(), error.message()));
  if (old.empty()) return old;
  const auto named = named_by_models(store);
  if (!named) return fail(named.error().code, fmt::format("keep all recordings: {}", named.error().text));
  std::erase_if(old, [&named](const fs::path& file) {
    const std::string name = file.filename();
    return named->contains(name.substr(0, name.find(".mcap")));
  });
  std::sort(old.begin(), old.end());
  for (const fs::path& file : old)
    if (!fs::remove(file, error) && error)
      return fail(ErrorCode::Io, fmt::format("remove {}: {}", file.string(), error.message()));
  return old;
}

}  // namespace abbe::daemon

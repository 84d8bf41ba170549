#pragma once
/// What [recording] keep_days takes away. Reads the models, so it is not for the hub or the
/// recorder. Ordinary world.

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

struct KeepRule {
  std::filesystem::file_time_type now;
  std::chrono::hours keep{};  ///< [recording] keep_days
  std::string running;        ///< RecorderOptions::name of this run
  /// How long this run has lasted without its clock being set.
  std::chrono::nanoseconds lasted{};
};

/// Removes what abbed recorded in `directory` (abbe-*.mcap, abbe-*.mcap.part) and last wrote longer
/// than `keep` ago. Ago: before now for what this run wrote, and for all once this run has lasted
/// longer than `keep`; until then, for what former runs wrote, before the newest of their
/// recordings, too: a clock that runs ahead does not make them old. What this run is writing
/// (.part) stays. Kept is what any model in the store names among its inputs, and what is dated
/// before there was an abbe: its clock was wrong. Returns what was removed. Nothing is removed if
/// the store is not there or a model cannot be read: it might be the one that names a file.
[[nodiscard]] Result<std::vector<std::filesystem::path>> remove_old_recordings(
    const std::filesystem::path& directory, const std::filesystem::path& store,
    const KeepRule& rule);

}  // namespace abbe::daemon

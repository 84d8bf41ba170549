#pragma once
/// What [recording] keep_days takes away. Reads the models, so it is not for the hub or the recorder.
/// Ordinary world.

#include <chrono>
#include <filesystem>
#include <vector>

#include "abbe/daemon/error.hpp"

namespace abbe::daemon {

/// Removes what abbed recorded in `directory` (abbe-*.mcap, abbe-*.mcap.part) and last wrote before `until`,
/// except what any model in the store names among its inputs; returns what was removed. Nothing is removed if
/// a model cannot be read: it might be the one that names a file.
[[nodiscard]] Result<std::vector<std::filesystem::path>> remove_old_recordings(
    const std::filesystem::path& directory, const std::filesystem::path& store,
    std::filesystem::file_time_type until);

}  // namespace abbe::daemon

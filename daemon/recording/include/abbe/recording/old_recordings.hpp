#pragma once
/// Removes recordings older than [recording] keep_days. May read all models, so do not call it
/// from the threads of the hub or the recorder. Not real-time.

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

struct KeepRule {
  std::filesystem::file_time_type now;
  std::chrono::hours keep{};  ///< value of [recording] keep_days
  std::string running;        ///< RecorderOptions::name of this run
  /// Duration of this run since its start or since its clock was last set.
  std::chrono::nanoseconds lasted{};
};

/// Removes recordings of abbed in `directory` (abbe-*.mcap, abbe-*.mcap.part) that were last
/// written more than `keep` ago. Returns the removed files.
///
/// The age of a file counts from `now` if the file is of this run, or if this run has lasted longer
/// than `keep`. Otherwise the age of files of former runs counts from the newest of them, if that
/// is earlier than `now`: files do not become old because the clock is wrongly ahead.
///
/// These files are kept:
/// - the file that this run is writing (.part);
/// - every file that a model in the store names among its inputs;
/// - files dated before the first version of abbe, because the clock was wrong when they were
///   written.
///
/// Nothing is removed if the store does not exist or a model cannot be read, because that model
/// might name one of the files.
[[nodiscard]] Result<std::vector<std::filesystem::path>> remove_old_recordings(
    const std::filesystem::path& directory, const std::filesystem::path& store,
    const KeepRule& rule);

}  // namespace abbe::daemon

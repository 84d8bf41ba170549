#pragma once
/// The recordings of abbed, for the page. Reads the folder at every call. Thread-safe.

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/base/file_descriptor.hpp"

namespace abbe::web {

/// [{"name", "bytes", "modified", "finished"}], newest first. Io if the folder cannot be read.
[[nodiscard]] daemon::Result<nlohmann::json> recordings_json(const std::filesystem::path& folder);

struct OpenRecording {
  daemon::FileDescriptor fd;
  std::uint64_t bytes = 0;
  /// Strong ETag ([RFC 9110] 8.8.3): the same only for the same bytes. Empty while the recording
  /// runs.
  std::string etag;
};
/// Usage unless `name` is the name of a recording (no folders); Io if there is no such file.
[[nodiscard]] daemon::Result<OpenRecording> open_recording(const std::filesystem::path& folder,
                                                           const std::string& name);

}  // namespace abbe::web

#pragma once
/// Types that all readers of files share: the identity of the file that was read, and the callback
/// that reports the progress of reading.

#include <filesystem>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/protocol/table/number_table.hpp"

namespace abbe::daemon {

/// Identifies a file that was read: its name without folder and the SHA-256 of the bytes that were
/// parsed.
struct InputFile {
  std::string name;
  std::string sha256;
  friend bool operator==(const InputFile&, const InputFile&) = default;
};

/// Hashes the file; Io if it cannot be read.
[[nodiscard]] Result<InputFile> hashed_file(const std::filesystem::path& file);

using protocol::ReadProgress;

}  // namespace abbe::daemon

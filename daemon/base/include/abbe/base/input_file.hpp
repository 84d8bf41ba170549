#pragma once
/// What every file reader returns or reports beside the content.

#include <functional>
#include <string>

namespace abbe::daemon {

/// Identifies a file that was read: its name without folder and the SHA-256 of the bytes that were
/// parsed.
struct InputFile {
  std::string name;
  std::string sha256;
  friend bool operator==(const InputFile&, const InputFile&) = default;
};

/// Called while a file is read, with ascending 0 <= fraction <= 1. May be empty.
using ReadProgress = std::function<void(double fraction)>;

}  // namespace abbe::daemon

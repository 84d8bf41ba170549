#pragma once
/// What every reader of a file gives beside the content.

#include <functional>
#include <string>

namespace abbe::daemon {

/// A file as it was read: its name without folder, and the SHA-256 of exactly the bytes that were
/// parsed.
struct InputFile {
  std::string name;
  std::string sha256;
  friend bool operator==(const InputFile&, const InputFile&) = default;
};

/// Called with 0 <= fraction <= 1, ascending; may be empty.
using ReadProgress = std::function<void(double fraction)>;

}  // namespace abbe::daemon

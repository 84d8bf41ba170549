#pragma once
/// Where the points of `abbe verify` come from when not out of a file.

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

struct LivePoints {
  VerificationFile file;  ///< from no file: `source` has no name
  /// Why some are missing: the daemon went away (Io), the recording is damaged inside
  /// (DataInsufficient).
  std::optional<Error> cut_short;
};

/// The standstills of a recording.
[[nodiscard]] Result<LivePoints> points_of_recording(const std::string& file);

/// The standstills of the machine the daemon watches, one line on stderr for each, until there are
/// `count` (0: as many as the daemon collects) or somebody presses Ctrl-C (or SIGTERM, SIGHUP).
/// `keep` gets all of them whenever there are new ones; what it says ends the collection.
[[nodiscard]] Result<LivePoints> points_of_daemon(
    const std::filesystem::path& socket, std::size_t count,
    const std::function<Result<void>(const VerificationFile&)>& keep);

}  // namespace abbe::daemon

#pragma once
/// The points of `abbe verify` from a recording or from the running daemon.

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

struct LivePoints {
  VerificationFile file;  ///< for points of the daemon `source` has no name
  /// Why points are missing: the daemon does not answer any more (Io), or the recording is damaged
  /// before its end (DataInsufficient).
  std::optional<Error> cut_short;
  std::string machine{};  ///< whose points they are; empty: not known
};

/// The points of a recording: one for each standstill of the machine.
[[nodiscard]] Result<LivePoints> points_of_recording(const std::string& file);

/// Collects points from the daemon: one for each standstill of its machine, until there are `count`
/// points (0: as many as the daemon collects), or until Ctrl-C, SIGTERM or SIGHUP. Prints one line
/// per point to stderr. `keep` is called with all points whenever there are new ones; an error of
/// `keep` ends the collection. `accept` is called with the name of the machine of the daemon
/// (empty:
/// not known) before the first point; its error is returned.
[[nodiscard]] Result<LivePoints> points_of_daemon(
    const std::filesystem::path& socket, std::size_t count,
    const std::function<Result<void>(const VerificationFile&)>& keep,
    const std::function<Result<void>(const std::string&)>& accept);

}  // namespace abbe::daemon

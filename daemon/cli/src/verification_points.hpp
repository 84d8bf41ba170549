#pragma once
/// The points of `abbe verify` from the running daemon.

#include <cstddef>
#include <filesystem>

#include "abbe/base/error.hpp"
#include "abbe/tasks/verify.hpp"

namespace abbe::daemon {

/// Collects points from the daemon: one for each standstill of its machine, until there are `count`
/// points (0: as many as the daemon collects), or until Ctrl-C, SIGTERM or SIGHUP. Prints one line
/// per point to stderr. `keep` is called with all points whenever there are new ones; an error of
/// `keep` ends the collection. `accept` is called with the name of the daemon's machine (empty: not
/// known) before the first point; its error is returned.
[[nodiscard]] Result<LivePoints> points_of_daemon(const std::filesystem::path& socket,
                                                  std::size_t count, const KeepPoints& keep,
                                                  const AcceptMachine& accept);

}  // namespace abbe::daemon

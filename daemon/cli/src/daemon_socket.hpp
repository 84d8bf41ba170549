#pragma once
/// Finds the running daemon for a command: by --socket, or by the socket in the configuration.

#include <CLI/App.hpp>
#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/tasks/forced_use.hpp"

namespace abbe::daemon {

/// A command that waits for the daemon ends with an error if the daemon has not answered for this
/// time.
inline constexpr std::chrono::seconds kDaemonTimeout{5};

struct DaemonSocket {
  std::string socket = "/run/abbe/control.sock";
  std::string config;
};

void add_socket_options(CLI::App& command, DaemonSocket& where);
[[nodiscard]] Result<std::filesystem::path> socket_path(const DaemonSocket& where);

}  // namespace abbe::daemon

#pragma once
/// How a command finds the running daemon: --socket, or the configuration that names it.

#include <CLI/App.hpp>
#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// For so long whoever waits for something goes on asking a daemon that does not answer.
inline constexpr std::chrono::seconds kPatienceWithoutDaemon{5};

struct DaemonSocket {
  std::string socket = "/run/abbe/control.sock";
  std::string config;
};

void add_socket_options(CLI::App& command, DaemonSocket& where);
[[nodiscard]] Result<std::filesystem::path> socket_path(const DaemonSocket& where);
/// Who gives this command: the user's name, for the record.
[[nodiscard]] std::string user_name();

}  // namespace abbe::daemon

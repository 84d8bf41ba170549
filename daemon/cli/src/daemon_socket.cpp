#include "daemon_socket.hpp"

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include "abbe/config/config.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

void add_socket_options(CLI::App& command, DaemonSocket& where) {
  auto* socket = command.add_option("--socket", where.socket, "control socket of abbed")
                     ->capture_default_str();
  command.add_option("-c,--config", where.config, "read the socket from this abbed.toml")
      ->excludes(socket);
}

Result<std::filesystem::path> socket_path(const DaemonSocket& where) {
  if (where.config.empty()) return std::filesystem::path{where.socket};
  auto config = load_config(where.config);
  ABBE_TRY(config);
  return config->control.socket;
}

}  // namespace abbe::daemon

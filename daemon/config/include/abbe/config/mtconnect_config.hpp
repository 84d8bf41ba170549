#pragma once
/// [mtconnect] of abbed.toml: the MTConnect adapter abbe-mtconnect. Not a member of Config, because
/// abbed only checks this table and does not use it.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

struct MtconnectConfig {
  std::string address = "127.0.0.1";  ///< numeric IPv4 or IPv6 address to listen on
  std::uint16_t port = 7878;          ///< 0: any free port, which abbe-mtconnect prints
  /// The heartbeat, which is sent to an agent in "* PONG". The agent then sends "* PING" with this
  /// period. Either side closes the connection if the other one is silent for twice this time.
  std::chrono::nanoseconds heartbeat = std::chrono::seconds{10};
};

struct MtconnectSettings {
  std::filesystem::path control_socket = "/run/abbe/control.sock";
  MtconnectConfig mtconnect;
};

/// Reads and checks the whole abbed.toml as load_config() does and returns [mtconnect]. Any thread.
[[nodiscard]] Result<MtconnectSettings> load_mtconnect_settings(const std::filesystem::path& file);

}  // namespace abbe::daemon

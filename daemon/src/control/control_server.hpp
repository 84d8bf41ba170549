#pragma once

#include <filesystem>
#include <memory>

#include "abbe/daemon/control_protocol.hpp"
#include "files/file_descriptor.hpp"

namespace abbe::daemon {

/// Serves a socket that listens at `path` already (listen_unix()): nothing is refused any more.
[[nodiscard]] std::unique_ptr<ControlServer> serve_control(FileDescriptor listener,
                                                           const std::filesystem::path& path,
                                                           ControlServer::Handler handler,
                                                           const ControlLimits& limits = {});

}  // namespace abbe::daemon

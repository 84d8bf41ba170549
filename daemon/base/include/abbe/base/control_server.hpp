#pragma once

#include <filesystem>
#include <memory>

#include "abbe/base/control_protocol.hpp"
#include "abbe/base/file_descriptor.hpp"

namespace abbe::daemon {

/// Serves a socket that listens at `path` already, see listen_unix(). Cannot fail.
[[nodiscard]] std::unique_ptr<ControlServer> serve_control(FileDescriptor listener,
                                                           const std::filesystem::path& path,
                                                           ControlServer::Handler handler,
                                                           const ControlLimits& limits = {});

}  // namespace abbe::daemon

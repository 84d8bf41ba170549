#pragma once
/// A connection to the control socket that is kept open for many requests. In contrast,
/// ask_daemon() of control_protocol.hpp opens a connection for each request. One thread.

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/base/error.hpp"
#include "abbe/base/file_descriptor.hpp"

namespace abbe::daemon {

class ControlConnection {
 public:
  explicit ControlConnection(std::filesystem::path socket_path) : path_(std::move(socket_path)) {}

  /// Sends one request and returns its answer. Connects first if there is no connection. An answer
  /// with "ok": false is an Error; after any other Error the next call connects anew.
  [[nodiscard]] Result<nlohmann::json> ask(
      const nlohmann::json& request, std::chrono::milliseconds time_out = std::chrono::seconds{5});

 private:
  [[nodiscard]] Result<nlohmann::json> exchange(const nlohmann::json& request,
                                                std::chrono::milliseconds time_out);

  std::filesystem::path path_;
  FileDescriptor fd_;
};

}  // namespace abbe::daemon

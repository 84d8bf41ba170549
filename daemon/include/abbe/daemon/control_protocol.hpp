#pragma once
/// The control API: one JSON object a line, request then answer, over a Unix stream socket that only the
/// daemon's user and group may open. A request is {"do": NAME, ...}; an answer {"ok": true, ...} or {"ok":
/// false, "code": WORD, "error": TEXT}, WORD one of data_insufficient, usage, bad_input, io, refused: the
/// exit code of whoever asked follows it. The server puts the user the kernel knows the client to be
/// (SO_PEERCRED) into every request as "user". Ordinary world.

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>

#include "abbe/daemon/error.hpp"

namespace abbe::daemon {

/// Serves the socket on a thread of its own. The handler runs on that thread; it must not block for long.
class ControlServer {
 public:
  using Handler = std::function<nlohmann::json(const nlohmann::json& request)>;

  /// Refuses when a live server already answers at `socket_path`; a file left behind by a dead one is
  /// replaced.
  [[nodiscard]] static Result<std::unique_ptr<ControlServer>> open(const std::filesystem::path& socket_path,
                                                                   Handler handler);
  virtual ~ControlServer() = default;
};

/// The answer that an Error becomes on the socket.
[[nodiscard]] nlohmann::json refusal(const Error& error);

/// One request and its answer. An answer with "ok": false becomes the Error it was made of.
[[nodiscard]] Result<nlohmann::json> ask_daemon(const std::filesystem::path& socket_path,
                                                const nlohmann::json& request,
                                                std::chrono::milliseconds time_out = std::chrono::seconds{5});

}  // namespace abbe::daemon

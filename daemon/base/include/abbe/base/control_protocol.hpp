#pragma once
/// The control API: one JSON object a line, request then answer, over a Unix stream socket that
/// only the daemon's user and group may open. A request is {"do": NAME, ...}; an answer {"ok":
/// true, ...} or {"ok": false, "code": WORD, "error": TEXT}, WORD one of data_insufficient, usage,
/// bad_input, io, refused: the exit code of whoever asked follows it. The server puts the user the
/// kernel knows the client to be (SO_PEERCRED) into every request as "user". A connection that is
/// closed for a newer one, or because it is idle, gets a last line with "ok": false. Ordinary
/// world.

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Of a request: a path of 10^5 vertices fits; the places on the way to a touch are five levels
/// deep.
inline constexpr JsonBounds kRequestBounds{.bytes = 4u << 20, .depth = 16};

/// The process at the other end of a connection, as the kernel knew it when it connected.
struct ControlPeer {
  std::string user = "somebody";
  uid_t uid = static_cast<uid_t>(-1);  ///< of nobody
  std::vector<gid_t> groups = {};      ///< its own and the supplementary ones
};

/// Connections beyond these take the place of the one that has been idle for longest: of the same
/// user if that user has too many, else of the user who has most.
struct ControlLimits {
  std::size_t connections = 32;
  std::size_t of_one_user = 16;
  std::chrono::milliseconds idle = std::chrono::minutes{1};  ///< without a byte in or out: closed
};

/// Serves the socket on a thread of its own. The handler runs on that thread; it must not block for
/// long.
class ControlServer {
 public:
  using Handler =
      std::function<nlohmann::json(const nlohmann::json& request, const ControlPeer& peer)>;

  /// Refuses when a live server already answers at `socket_path`; a file left behind by a dead one
  /// is replaced.
  [[nodiscard]] static Result<std::unique_ptr<ControlServer>> open(
      const std::filesystem::path& socket_path, Handler handler, const ControlLimits& limits = {});
  virtual ~ControlServer() = default;
};

/// The answer that an Error becomes on the socket.
[[nodiscard]] nlohmann::json refusal(const Error& error);

/// One request and its answer. An answer with "ok": false becomes the Error it was made of.
[[nodiscard]] Result<nlohmann::json> ask_daemon(
    const std::filesystem::path& socket_path, const nlohmann::json& request,
    std::chrono::milliseconds time_out = std::chrono::seconds{5});

}  // namespace abbe::daemon

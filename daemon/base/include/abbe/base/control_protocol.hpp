#pragma once
/// The control API: one JSON object per line, request then answer, over a Unix stream socket that
/// only the daemon's user and group may open.
///
///   request:  {"do": NAME, ...}
///   answer:   {"ok": true, ...}
///         or  {"ok": false, "code": WORD, "error": TEXT}
///
/// WORD is one of data_insufficient, usage, bad_input, io, refused, stop_not_confirmed,
/// stop_not_sent; it determines the exit code of the client program. The server adds the name of
/// the client's user, taken from the kernel (SO_PEERCRED), to every request as "user". A connection
/// that the server closes because it is idle or to make place for a newer one gets a last line with
/// "ok": false. Not for real-time threads.

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

/// Limits of a request. A path of 10^5 vertices fits; the deepest request has five levels (the
/// positions on the way to a touch).
inline constexpr JsonBounds kRequestBounds{.bytes = 4u << 20, .depth = 16};

/// The process at the other end of a connection, with the ids that the kernel recorded when the
/// process connected.
struct ControlPeer {
  std::string user = "unknown";
  uid_t uid = static_cast<uid_t>(-1);  ///< the default is not a user
  std::vector<gid_t> groups = {};      ///< primary group and supplementary groups
};

/// If a new connection exceeds one of these limits, the server closes the connection that has been
/// idle longest. If the new client's user already has `of_one_user` connections, one of that user
/// is closed, else one of the user with the most connections.
struct ControlLimits {
  std::size_t connections = 32;
  std::size_t of_one_user = 16;
  /// A connection without traffic for this time is closed.
  std::chrono::milliseconds idle = std::chrono::minutes{1};
};

/// Serves the socket on its own thread. The handler runs on that thread and must not block for
/// long. Requests of more than 64 kB take longer to read and are answered on a second thread, one
/// after the other. The handler is therefore called by two threads.
class ControlServer {
 public:
  using Handler =
      std::function<nlohmann::json(const nlohmann::json& request, const ControlPeer& peer)>;

  /// An Error if another process already listens at `socket_path`. A socket file without a listener
  /// is replaced.
  [[nodiscard]] static Result<std::unique_ptr<ControlServer>> open(
      const std::filesystem::path& socket_path, Handler handler, const ControlLimits& limits = {});
  virtual ~ControlServer() = default;
};

/// The answer ("ok": false) that reports `error` to the client.
[[nodiscard]] nlohmann::json refusal(const Error& error);

/// Sends one request and returns its answer. An answer with "ok": false is returned as an Error.
[[nodiscard]] Result<nlohmann::json> ask_daemon(
    const std::filesystem::path& socket_path, const nlohmann::json& request,
    std::chrono::milliseconds time_out = std::chrono::seconds{5});

}  // namespace abbe::daemon

#pragma once

#include <openssl/ssl.h>

#include <atomic>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "abbe/base/file_descriptor.hpp"
#include "connection_stream.hpp"
#include "http.hpp"

namespace abbe::web {

struct FreeTlsContext {
  void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
};
using TlsContext = std::unique_ptr<SSL_CTX, FreeTlsContext>;

/// A server of httplib with limits of its own for connections: httplib reads lines and chunked
/// bodies without a limit of size or total time, and ends after an error of accept(). Requests for
/// ranges are answered with the whole, except of a recording (kRangeHeader). A connection
/// ends after a request with a body, because a body that was refused may be unread.
class LimitedServer final : public httplib::Server {
 public:
  static constexpr std::size_t kConnectionsOfAddress = 48;
  static constexpr std::size_t kRequestsOfConnection = 200;
  static constexpr std::chrono::seconds kBetweenRequests{1};

  /// What the server calls, from any thread.
  struct Calls {
    /// A subject, as in LimitedLog, and a line.
    std::function<void(const std::string&, const std::string&)> report;
    /// False if a client (client_network()) sends too many requests.
    std::function<bool(const std::string& network)> admits;
  };

  /// `tls`: null without TLS.
  LimitedServer(TlsContext tls, ConnectionLimits limits, Calls calls);
  LimitedServer(const LimitedServer&) = delete;
  LimitedServer& operator=(const LimitedServer&) = delete;
  ~LimitedServer() override;

  /// The listening socket, after the bind. httplib lets 5 connections wait for accept(), which the
  /// files of one page exceed.
  [[nodiscard]] int listener();
  /// Ends all waiting of open connections.
  void end_connections() { stopping_ = true; }

  /// A place for a connection of `address`, which its destructor gives back; null if its network
  /// (client_network()) has kConnectionsOfAddress already. Any thread.
  [[nodiscard]] std::shared_ptr<void> place_for(const std::string& address);
  /// Serves the requests of a connection, and closes it. `crowded`: of ConnectionWatch. Any thread.
  void serve_connection(daemon::FileDescriptor fd, const std::string& address,
                        const std::function<bool()>& crowded);

 private:
  /// True if input of the client may be unread.
  [[nodiscard]] bool serve(ConnectionStream& stream, const std::string& address);
  /// Answers a request that admits() refuses.
  void refuse_rate(ConnectionStream& stream, const std::string& address);
  void report_fault(const ConnectionStream& stream, const std::string& address);
  /// Reads what the client still sends: after close() with unread input the kernel would discard
  /// the answer (RFC 9112, 9.6).
  void discard_input(int fd) const;

  TlsContext tls_;
  ConnectionLimits limits_;
  Calls calls_;
  std::atomic<bool> stopping_{false};
  std::mutex mutex_;
  std::map<std::string, std::size_t> connections_;  ///< open ones by network; of mutex_
};

/// A request that announces a body.
[[nodiscard]] bool has_body(const httplib::Request& request);

}  // namespace abbe::web

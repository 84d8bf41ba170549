#pragma once

#include <openssl/ssl.h>

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "connection_stream.hpp"
#include "http.hpp"

namespace abbe::web {

struct FreeTlsContext {
  void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
};
using TlsContext = std::unique_ptr<SSL_CTX, FreeTlsContext>;

/// A server of httplib with limits of its own for connections: httplib reads lines and chunked
/// bodies without a limit of size or total time. Requests for ranges are answered with the whole:
/// httplib 0.11 does not check the end of a range. A connection ends after a request with a body,
/// because a body that was refused may be unread.
class LimitedServer final : public httplib::Server {
 public:
  static constexpr std::size_t kConnectionsOfAddress = 48;
  static constexpr std::size_t kRequestsOfConnection = 200;
  static constexpr std::chrono::milliseconds kBetweenRequests{1000};

  /// `tls`: null without TLS. `report`: a subject, as in LimitedReport, and a line. Any thread.
  LimitedServer(TlsContext tls, ConnectionLimits limits,
                std::function<void(const std::string&, const std::string&)> report);

  /// After the bind: httplib lets 5 connections wait for accept(), which the files of one page exceed.
  void let_more_connections_wait();

 private:
  bool process_and_close_socket(socket_t fd) override;
  void serve(ConnectionStream& stream);
  void report_fault(const ConnectionStream& stream, const std::string& address);
  /// False if the address has kConnectionsOfAddress already.
  [[nodiscard]] bool enter(const std::string& address);
  void leave(const std::string& address);

  TlsContext tls_;
  ConnectionLimits limits_;
  std::function<void(const std::string&, const std::string&)> report_;
  std::mutex mutex_;
  std::map<std::string, std::size_t> connections_;  ///< open ones by address; of mutex_
};

}  // namespace abbe::web

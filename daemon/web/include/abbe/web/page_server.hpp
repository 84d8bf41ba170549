#pragma once
/// The HTTP server of the page, and everything that it needs: the connection to abbed, the views of
/// store and recordings, users and sessions. Limits, each reported with the address of the browser:
///
///   open pages                 [web] most_pages
///   requests of one address    kRequestsPerSecond on average
///   a page that does not read  closed after kWriteTimeOut
///   a request                  kMostRequestBytes, kRequestTime from its first byte to its last;
///                              its lines kMostHeadBytes, kMostHeadLines
///   an answer                  kSlowestReader_bytes_per_s on average
///   connections of one address LimitedServer::kConnectionsOfAddress
///   silence or a slow reader   kCrowdedTime while connections wait for a thread
///
/// One address is an IPv4 address or the network of an IPv6 address (client_network()).
///
/// Whatever a browser does, abbed gets the requests of one client: those of DaemonFeed, and one at
/// a time of logged-in users.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/config/web_config.hpp"

namespace abbe::web {

inline constexpr double kRequestsPerSecond = 40.0, kRequestsAtOnce = 200.0;
inline constexpr std::chrono::milliseconds kWriteTimeOut{5000}, kRequestTime{10000};
inline constexpr std::size_t kMostRequestBytes = 1u << 20;

struct PageOptions {
  daemon::WebSettings settings;
  std::filesystem::path config_file;  ///< shown as understood
  std::chrono::milliseconds write_time_out = kWriteTimeOut, request_time = kRequestTime;
  /// Receives one line per event: log in, change, refusal, limit. Any thread.
  std::function<void(const std::string&)> report;
};

class PageServer {
 public:
  /// Listens and serves on threads of its own. Io if the address is in use or not of this computer;
  /// BadInput for a certificate that cannot be used.
  [[nodiscard]] static daemon::Result<std::unique_ptr<PageServer>> start(PageOptions options);
  virtual ~PageServer() = default;
  [[nodiscard]] virtual std::uint16_t port() const = 0;
  /// Why browsers cannot reach the page, or why it is not kept up to date; empty: it is served. Any
  /// thread.
  [[nodiscard]] virtual std::string fault() const = 0;
  /// What is to be done soon although the page is served: the certificate expires. Empty: nothing.
  /// The page shows it. Any thread.
  [[nodiscard]] virtual std::string notice() const = 0;
  /// True once the server cannot accept connections any more: only a new start helps.
  [[nodiscard]] virtual bool ended() const = 0;
};

}  // namespace abbe::web

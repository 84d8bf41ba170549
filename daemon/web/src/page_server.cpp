#include "abbe/web/page_server.hpp"

#include <fmt/format.h>
#include <openssl/err.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "abbe/web/certificate.hpp"
#include "limited_server.hpp"
#include "page_context.hpp"
#include "responses.hpp"
#include "worker_pool.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::Result;
using Handling = httplib::Server::HandlerResponse;

/// Besides one for each open page. More than the connections of one address, so that another one
/// still gets an answer.
constexpr std::size_t kThreadsForRequests = LimitedServer::kConnectionsOfAddress + 16;
constexpr std::chrono::milliseconds kStartPeriod{1};
constexpr std::size_t kLongestPath = 300;
constexpr std::size_t kMostHeadBytes = 64 * 1024;
constexpr int kSendBuffer = 64 * 1024;          ///< limits what waits for a page that does not read
constexpr std::string_view kApi = "/api/";  ///< requests that change something begin so

/// Of the listening socket; accepted connections inherit them. SO_REUSEPORT, httplib's default,
/// would let another process take a part of the connections.
void set_socket_options(socket_t socket) {
  const auto set = [socket](int level, int option, int value) {
    (void)::setsockopt(socket, level, option, &value, sizeof value);
  };
  set(SOL_SOCKET, SO_REUSEADDR, 1);
  set(SOL_SOCKET, SO_SNDBUF, kSendBuffer);
}

/// The name in a Host header, without the port: "[::1]:8440" is "::1".
std::string host_name(const std::string& host) {
  if (host.starts_with('[')) return host.substr(1, host.find(']') - 1);
  return host.substr(0, host.find(':'));
}

/// A page of another site can make its own name refer to this computer (DNS rebinding): then the
/// browser sends that name.
bool is_own_name(const std::string& host, const daemon::WebConfig& web) {
  const std::string name = host_name(host);
  return name == "localhost" || name == web.address || name == "127.0.0.1" || name == "::1" ||
         std::ranges::find(web.host_names, name) != web.host_names.end();
}

class HttpPageServer final : public PageServer {
 public:
  HttpPageServer(PageOptions options, TlsContext tls)
      : context_(std::move(options)),
        server_(std::move(tls),
                {.request_bytes = kMostHeadBytes + kMostRequestBytes,
                 .request_time = context_.options.request_time,
                 .write_time = context_.options.write_time_out},
                [this](const std::string& subject, const std::string& line) {
                  context_.report.line(subject, line);
                }) {
    set_limits();
    server_.set_pre_routing_handler(
        [this](const httplib::Request& request, httplib::Response& response) {
          return before_routing(request, response);
        });
    // Also of answers that httplib makes itself.
    server_.set_post_routing_handler(
        [](const httplib::Request& request, httplib::Response& response) {
          if (!response.has_header("Content-Security-Policy")) add_security_headers(response);
          if (request.method != "GET" && request.method != "HEAD")
            response.set_header("Connection", "close");
        });
    server_.Post("/api/[a-z]+",
                 [this](const httplib::Request& request, httplib::Response& response,
                        const httplib::ContentReader& read) { post(request, response, read); });
    server_.set_exception_handler(
        [this](const httplib::Request& request, httplib::Response& response, std::exception_ptr e) {
          report_exception(request, response, e);
        });
  }
  HttpPageServer(const HttpPageServer&) = delete;
  HttpPageServer& operator=(const HttpPageServer&) = delete;
  ~HttpPageServer() override {
    context_.board.close();
    server_.stop();
    if (thread_.joinable()) thread_.join();
  }

  [[nodiscard]] Result<void> listen() {
    const auto& web = context_.options.settings.web;
    if (web.port == 0) {
      port_ = server_.bind_to_any_port(web.address);
    } else if (server_.bind_to_port(web.address, web.port)) {
      port_ = web.port;
    }
    if (port_ <= 0)
      return daemon::fail(ErrorCode::Io,
                          fmt::format("listen {} port {}: the port is in use, or the address is "
                                      "not of this computer ([web] address, port)",
                                      web.address, web.port));
    context_.port = port_;
    server_.let_more_connections_wait();
    thread_ = std::thread([this] {
      (void)server_.listen_after_bind();
      ended_ = true;
    });
    // stop() has no effect on a server that does not run yet.
    while (!server_.is_running() && !ended_) std::this_thread::sleep_for(kStartPeriod);
    return {};
  }
  [[nodiscard]] bool serving() const override { return !ended_; }
  [[nodiscard]] std::uint16_t port() const override { return static_cast<std::uint16_t>(port_); }

 private:
  void set_limits() {
    server_.set_socket_options(set_socket_options);
    server_.set_tcp_nodelay(true);
    server_.set_payload_max_length(kMostRequestBytes);
    const std::size_t threads = kThreadsForRequests + context_.options.settings.web.most_pages;
    server_.new_task_queue = [this, threads] {
      return new WorkerPool(threads, [this] {
        context_.report.line("waiting", fmt::format("{} connections wait: more than the page needs",
                                                    WorkerPool::kMostWaiting));
      });
    };
  }

  Handling before_routing(const httplib::Request& request, httplib::Response& response) {
    add_security_headers(response);
    if (!context_.rate.take(request.remote_addr, std::chrono::steady_clock::now())) {
      context_.report.line("rate " + request.remote_addr,
                           fmt::format("{}: more than {} requests/s: refused", request.remote_addr,
                                       kRequestsPerSecond));
      response.set_header("Retry-After", "2");
      send_error(response, 429, "too many requests");
      return Handling::Handled;
    }
    if (!is_own_name(request.get_header_value("Host"), context_.options.settings.web)) {
      const std::string host = request.get_header_value("Host").substr(0, 80);
      context_.report.line("host", fmt::format("{}: refused: \"{}\" is not a name of this page "
                                               "([web] host_names)",
                                               peer_of(request), host));
      send_error(response, 421, "this page has another name: see [web] host_names");
      return Handling::Handled;
    }
    if (request.path.size() > kLongestPath) {
      send_error(response, 414, "the path is too long");
      return Handling::Handled;
    }
    if (request.method == "POST") return before_post(request, response);
    if (request.method == "GET" || request.method == "HEAD") {
      answer_get(context_, request, response);
    } else {
      send_error(response, 405, "only GET, HEAD and POST");
    }
    return Handling::Handled;
  }

  /// httplib reads the body of a request that it does not know, and decompresses it.
  Handling before_post(const httplib::Request& request, httplib::Response& response) {
    if (request.has_header("Content-Encoding")) {
      send_error(response, 415, "a compressed request is not accepted");
      return Handling::Handled;
    }
    if (request.path.starts_with(kApi) &&
        request.path.find_first_not_of("abcdefghijklmnopqrstuvwxyz", kApi.size()) ==
            std::string::npos)
      return Handling::Unhandled;
    send_error(response, 404, "there is no such request");
    return Handling::Handled;
  }

  void post(const httplib::Request& request, httplib::Response& response,
            const httplib::ContentReader& read) {
    std::string body;
    const bool whole = read([&body](const char* bytes, std::size_t size) {
      body.append(bytes, size);
      return body.size() <= kMostRequestBytes;
    });
    if (whole) return answer_post(context_, request, body, response);
    context_.report.line("large " + request.remote_addr,
                         fmt::format("{}: {} refused: a request of more than {} bytes",
                                     peer_of(request), request.path, kMostRequestBytes));
    send_error(response, 413, fmt::format("the request has more than {} bytes", kMostRequestBytes));
  }

  void report_exception(const httplib::Request& request, httplib::Response& response,
                        const std::exception_ptr& exception) {
    std::string what = "unknown";
    try {
      std::rethrow_exception(exception);
    } catch (const std::exception& error) {
      what = error.what();
    } catch (...) {
      what = "not a std::exception";
    }
    context_.report.line("internal error", fmt::format("{}: internal error in {}: {}",
                                                       peer_of(request), request.path, what));
    send_error(response, 500, "internal error: see the log of abbe-web");
  }

  PageContext context_;
  LimitedServer server_;
  int port_ = 0;
  std::atomic<bool> ended_{false};
  std::thread thread_;
};

/// Null without TLS.
Result<TlsContext> tls_of(const daemon::WebConfig& web) {
  if (!web.tls()) return TlsContext{};
  if (auto valid = check_certificate(web.certificate, std::chrono::system_clock::now()); !valid)
    return tl::unexpected(valid.error());
  TlsContext tls{SSL_CTX_new(TLS_server_method())};
  if (tls && SSL_CTX_set_min_proto_version(tls.get(), TLS1_2_VERSION) == 1 &&
      SSL_CTX_use_certificate_chain_file(tls.get(), web.certificate.c_str()) == 1 &&
      SSL_CTX_use_PrivateKey_file(tls.get(), web.key.c_str(), SSL_FILETYPE_PEM) == 1 &&
      SSL_CTX_check_private_key(tls.get()) == 1) {
    // httplib calls write() again with another buffer that has the same content.
    SSL_CTX_set_mode(tls.get(),
                     SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
    return tls;
  }
  ERR_clear_error();
  return daemon::fail(ErrorCode::BadInput,
                      fmt::format("certificate {}, key {}: not a pair, or the key cannot be read "
                                  "([web] certificate, key)",
                                  web.certificate.string(), web.key.string()));
}

}  // namespace

std::string peer_of(const httplib::Request& request) {
  return fmt::format("{}:{}", request.remote_addr, request.remote_port);
}

std::string cookie_name(const PageContext& context) {
  return fmt::format("abbe_session_{}", context.port.load());
}

std::optional<WebSession> session_of(PageContext& context, const httplib::Request& request,
                                     SessionUse use) {
  const std::string name = cookie_name(context) + "=";
  const std::string cookies = "; " + request.get_header_value("Cookie");
  const auto at = cookies.find("; " + name);
  if (at == std::string::npos) return std::nullopt;
  const auto begin = at + 2 + name.size();
  return context.sessions.find(cookies.substr(begin, cookies.find(';', begin) - begin),
                               std::chrono::steady_clock::now(), use);
}

Result<std::unique_ptr<PageServer>> PageServer::start(PageOptions options) {
  auto tls = tls_of(options.settings.web);
  if (!tls) return tl::unexpected(tls.error());
  auto page = std::make_unique<HttpPageServer>(std::move(options), std::move(*tls));
  if (auto listening = page->listen(); !listening) return tl::unexpected(listening.error());
  return page;
}

}  // namespace abbe::web

#include "abbe/web/page_server.hpp"

#include <fmt/format.h>
#include <openssl/err.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "abbe/result/try.hpp"
#include "abbe/web/certificate.hpp"
#include "accept_loop.hpp"
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
/// Of a connection for a thread, after which the watchdog restarts the page. Longer than the
/// slowest client may read an answer: clients that fill all threads must not end the sessions of
/// the others.
constexpr std::chrono::minutes kLongestWait{5};
/// Of a connection for a thread, after which silent and slow clients get only kCrowdedTime.
constexpr std::chrono::milliseconds kCrowdedAfter{500};
constexpr std::size_t kLongestPath = 300;
constexpr int kSendBuffer = 64 * 1024;      ///< limits what waits for a page that does not read
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

/// The announced length; nullopt: none, several or not a number.
std::optional<std::uint64_t> length_of(const httplib::Request& request) {
  if (request.get_header_value_count("Content-Length") != 1) return std::nullopt;
  const std::string text = request.get_header_value("Content-Length");
  std::uint64_t length = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), length);
  if (read.ec != std::errc{} || read.ptr != text.data() + text.size()) return std::nullopt;
  return length;
}

/// One header for each name: httplib adds its own beside one of the same name.
void replace_header(httplib::Response& response, const char* name, const char* value) {
  response.headers.erase(name);
  response.set_header(name, value);
}

class HttpPageServer final : public PageServer {
 public:
  HttpPageServer(PageOptions options, TlsContext tls)
      : context_(std::move(options)),
        server_(std::move(tls),
                {.body_bytes = kMostRequestBytes + kMostRequestBytes / 2,
                 .request_time = context_.options.request_time,
                 .write_time = context_.options.write_time_out},
                {.report = [this](const std::string& subject,
                                  const std::string& line) { context_.report.line(subject, line); },
                 .admits =
                     [this](const std::string& network) {
                       return context_.rate.take(network, std::chrono::steady_clock::now());
                     }}) {
    set_limits();
    server_.set_pre_routing_handler(
        [this](const httplib::Request& request, httplib::Response& response) {
          return before_routing(request, response);
        });
    // Also of answers that httplib makes itself.
    server_.set_post_routing_handler(
        [](const httplib::Request& request, httplib::Response& response) {
          if (!response.has_header("Content-Security-Policy")) add_security_headers(response);
          const bool stays = !response.has_header("Connection") && request.version == "HTTP/1.1";
          if (stays && !has_body(request)) return;
          replace_header(response, "Connection", "close");
          response.headers.erase("Keep-Alive");
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
    context_.stopping = true;
    context_.models.stop();
    context_.replays.stop();
    context_.identifications.stop();
    accepting_.reset();
    context_.board.close();
    server_.end_connections();
    workers_.reset();
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
    auto workers = WorkerPool::start(
        kThreadsForRequests + web.most_pages,
        [this](const std::string& line) { context_.report.line("internal error", line); });
    ABBE_TRY(workers);
    workers_ = std::move(*workers);
    const auto report = [this](const std::string& subject, const std::string& line) {
      context_.report.line(subject, line);
    };
    try {
      accepting_.emplace(
          server_.listener(), [this](daemon::FileDescriptor fd) { take(std::move(fd)); }, report);
    } catch (const std::system_error& error) {
      return daemon::fail(ErrorCode::Io,
                          fmt::format("start the thread that accepts connections: {} (TasksMax= of "
                                      "the unit, or the limit of processes of the user)",
                                      error.code().message()));
    }
    return {};
  }
  [[nodiscard]] std::string fault() const override {
    const auto now = std::chrono::steady_clock::now();
    if (auto fault = accepting_->fault(now); !fault.empty()) return fault;
    const auto wait = std::chrono::duration_cast<std::chrono::seconds>(workers_->longest_wait(now));
    if (wait >= kLongestWait)
      return fmt::format("a connection has waited for {} s: all threads are busy", wait.count());
    return context_.feed.fault(now);
  }
  [[nodiscard]] std::string notice() const override { return context_.notice(); }
  [[nodiscard]] bool ended() const override { return accepting_->ended(); }
  [[nodiscard]] std::uint16_t port() const override { return static_cast<std::uint16_t>(port_); }

 private:
  void set_limits() {
    server_.set_socket_options(set_socket_options);
    server_.set_payload_max_length(kMostRequestBytes);
  }

  /// On the thread that accepts.
  void take(daemon::FileDescriptor fd) {
    const std::string address = client_address(fd.get());
    auto place = server_.place_for(address);
    if (place == nullptr) return;
    // std::function copies what it holds.
    const auto kept = std::make_shared<daemon::FileDescriptor>(std::move(fd));
    if (workers_->enqueue([this, kept, address, place = std::move(place)](const WorkerPool& pool) {
          server_.serve_connection(std::move(*kept), address, [&pool] {
            return pool.longest_wait(WorkerPool::Clock::now()) > kCrowdedAfter;
          });
        }))
      return;
    context_.report.line("waiting", fmt::format("{}: closed: {} connections wait already", address,
                                                WorkerPool::kMostWaiting));
  }

  Handling before_routing(const httplib::Request& request, httplib::Response& response) {
    add_security_headers(response);
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
      if (has_body(request)) {
        send_error(response, 400, "a GET or HEAD request has no body");
        return Handling::Handled;
      }
      answer_get(context_, request, response);
    } else {
      send_error(response, 405, "only GET, HEAD and POST");
    }
    return Handling::Handled;
  }

  /// Before httplib reads the body: it would decompress it, and parse multipart/form-data with a
  /// regular expression and a search whose time grows with the square of the size.
  Handling before_post(const httplib::Request& request, httplib::Response& response) {
    if (request.has_header("Content-Encoding")) {
      send_error(response, 415, "a compressed request is not accepted");
      return Handling::Handled;
    }
    if (!request.get_header_value("Content-Type").starts_with(kJson)) {
      send_error(response, 415, "the request must be application/json");
      return Handling::Handled;
    }
    const auto length = length_of(request);
    if (request.has_header("Transfer-Encoding") == request.has_header("Content-Length") ||
        (request.has_header("Content-Length") && !length)) {
      send_error(response, 400, "the request needs one Content-Length, or chunks");
      return Handling::Handled;
    }
    if (length && *length > kMostRequestBytes) {
      refuse_size(request, response);
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
    if (body.size() > kMostRequestBytes) return refuse_size(request, response);
    send_error(response, 400, "the body of the request is not complete");
  }

  void refuse_size(const httplib::Request& request, httplib::Response& response) {
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
  std::unique_ptr<WorkerPool> workers_;
  std::optional<AcceptLoop> accepting_;  // last: its thread uses the members above
};

/// Who reads the key can pretend to be this page.
bool others_may_read(const std::filesystem::path& key) {
  struct stat seen {};
  return ::stat(key.c_str(), &seen) == 0 && (seen.st_mode & (S_IROTH | S_IWOTH)) != 0;
}

/// Null without TLS.
Result<TlsContext> tls_of(const daemon::WebConfig& web) {
  if (!web.tls()) return TlsContext{};
  ABBE_TRY(check_certificate(web.certificate, std::chrono::system_clock::now()));
  TlsContext tls{SSL_CTX_new(TLS_server_method())};
  if (tls && SSL_CTX_set_min_proto_version(tls.get(), TLS1_2_VERSION) == 1 &&
      SSL_CTX_use_certificate_chain_file(tls.get(), web.certificate.c_str()) == 1 &&
      SSL_CTX_use_PrivateKey_file(tls.get(), web.key.c_str(), SSL_FILETYPE_PEM) == 1 &&
      SSL_CTX_check_private_key(tls.get()) == 1) {
    SSL_CTX_set_options(tls.get(), SSL_OP_NO_RENEGOTIATION);  // costs the server a key exchange
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
  ABBE_TRY(tls);
  if (const auto& key = options.settings.web.key; others_may_read(key))
    options.report(fmt::format(
        "warning: key {}: other users may read it: chgrp abbe-web, chmod 0640", key.string()));
  auto page = std::make_unique<HttpPageServer>(std::move(options), std::move(*tls));
  ABBE_TRY(page->listen());
  return page;
}

}  // namespace abbe::web

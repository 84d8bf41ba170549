#include "limited_server.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <string_view>
#include <utility>

#include "abbe/web/client_network.hpp"
#include "abbe/web/page_server.hpp"

namespace abbe::web {
namespace {

/// A connection whose client acknowledges nothing for this time ends: a tablet that is out of reach
/// would keep its thread for many minutes (tcp(7)).
constexpr std::chrono::milliseconds kVanished{15000};
constexpr std::chrono::milliseconds kDiscardTime{1000}, kDiscardStep{200};

/// Answers a head that httplib does not get to see.
void refuse_head(ConnectionStream& stream) {
  const bool is_long = stream.fault() == ConnectionStream::Fault::LongHead;
  if (!is_long && stream.fault() != ConnectionStream::Fault::SlowRequest &&
      stream.fault() != ConnectionStream::Fault::Crowded)
    return;
  const std::string_view status =
      is_long ? "431 Request Header Fields Too Large" : "408 Request Timeout";
  const std::string answer =
      fmt::format("HTTP/1.1 {}\r\nConnection: close\r\nContent-Length: 0\r\n\r\n", status);
  (void)stream.write(answer.data(), answer.size());
}

}  // namespace

LimitedServer::LimitedServer(TlsContext tls, ConnectionLimits limits, Calls calls)
    : tls_(std::move(tls)), limits_(limits), calls_(std::move(calls)) {
  set_keep_alive_max_count(kRequestsOfConnection);  // stated in answers
  set_keep_alive_timeout(kBetweenRequests.count());
}

LimitedServer::~LimitedServer() {
  daemon::FileDescriptor close{svr_sock_.exchange(INVALID_SOCKET)};
}

int LimitedServer::listener() {
  constexpr int kWaiting = 128;
  (void)::listen(svr_sock_, kWaiting);
  return svr_sock_;
}

std::shared_ptr<void> LimitedServer::place_for(const std::string& address) {
  const std::string network = client_network(address);
  const auto leave = [this, network](void*) {
    const std::lock_guard leaving(mutex_);
    const auto at = connections_.find(network);
    if (at != connections_.end() && --at->second == 0) connections_.erase(at);
  };
  bool has_place = false;
  {
    const std::lock_guard lock(mutex_);
    std::size_t& open = connections_[network];
    has_place = open < kConnectionsOfAddress;
    if (has_place) ++open;
  }
  // Without the lock: std::shared_ptr calls `leave` if it finds no memory for itself.
  if (has_place) return {this, leave};
  calls_.report("connections " + network, fmt::format("{}: more than {} connections: closed",
                                                      network, kConnectionsOfAddress));
  return nullptr;
}

void LimitedServer::serve_connection(daemon::FileDescriptor fd, const std::string& address,
                                     const std::function<bool()>& crowded) {
  const unsigned vanished_ms = kVanished.count();
  const int without_delay = 1;
  (void)::setsockopt(fd.get(), IPPROTO_TCP, TCP_USER_TIMEOUT, &vanished_ms, sizeof vanished_ms);
  (void)::setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &without_delay, sizeof without_delay);
  bool unread = false;
  {
    ConnectionStream stream(fd.get(), tls_.get(), limits_,
                            {[this] { return stopping_.load(); }, crowded});
    if (!tls_ || stream.accept()) unread = serve(stream, address);
    report_fault(stream, address);
  }
  if (unread) discard_input(fd.get());
}

bool LimitedServer::serve(ConnectionStream& stream, const std::string& address) {
  for (std::size_t n = 1; n <= kRequestsOfConnection; ++n) {
    if (!stream.wait_for_request(kBetweenRequests)) return false;
    if (!stream.read_head()) {
      refuse_head(stream);
      return true;
    }
    if (!calls_.admits(client_network(address))) {
      refuse_rate(stream, address);
      return true;
    }
    bool closed = false, unread = true;  // also if the request cannot be parsed
    const bool served =
        process_request(stream, n == kRequestsOfConnection, closed,
                        [&unread](httplib::Request& request) { unread = has_body(request); });
    if (!served || closed || unread) return unread;
  }
  return false;
}

/// Before the request is parsed. The connection ends: a flood keeps no thread.
void LimitedServer::refuse_rate(ConnectionStream& stream, const std::string& address) {
  constexpr std::string_view kBody = R"({"error":"too many requests"})";
  const std::string answer = fmt::format(
      "HTTP/1.1 429 Too Many Requests\r\nConnection: close\r\nRetry-After: 2\r\n"
      "Cache-Control: no-store\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n{}",
      kBody.size(), kBody);
  (void)stream.write(answer.data(), answer.size());
  calls_.report("rate " + client_network(address),
                fmt::format("{}: more than {} requests/s: refused", address, kRequestsPerSecond));
}

void LimitedServer::discard_input(int fd) const {
  (void)::shutdown(fd, SHUT_WR);
  const auto until = ConnectionStream::Clock::now() + kDiscardTime;
  std::array<char, 16384> buffer;  // NOLINT: recv() fills what is used
  while (!stopping_ && ConnectionStream::Clock::now() < until) {
    pollfd polled{.fd = fd, .events = POLLIN, .revents = 0};
    if (::poll(&polled, 1, static_cast<int>(kDiscardStep.count())) <= 0) continue;
    if (::recv(fd, buffer.data(), buffer.size(), 0) <= 0) return;
  }
}

void LimitedServer::report_fault(const ConnectionStream& stream, const std::string& address) {
  using Fault = ConnectionStream::Fault;
  switch (stream.fault()) {
    case Fault::LongHead:
      return calls_.report(
          "large " + address,
          fmt::format("{}: a request with more than {} bytes or {} lines before its "
                      "body: closed",
                      address, kMostHeadBytes, kMostHeadLines));
    case Fault::LongBody:
      return calls_.report(
          "large " + address,
          fmt::format("{}: a request of more than {} bytes: closed", address, limits_.body_bytes));
    case Fault::SlowRequest:
      return calls_.report("slow " + address,
                           fmt::format("{}: a request took longer than {} ms: closed", address,
                                       limits_.request_time.count()));
    case Fault::SlowReader:
      return calls_.report(
          "unread " + address,
          fmt::format("{}: an answer is not read, or by less than {} bytes/s: closed", address,
                      kSlowestReader_bytes_per_s));
    case Fault::Crowded:
      return calls_.report("crowded " + client_network(address),
                           fmt::format("{}: silent or slow for {} ms while other connections wait "
                                       "for a thread: closed",
                                       address, kCrowdedTime.count()));
    case Fault::None:
      return;
  }
}

bool has_body(const httplib::Request& request) {
  if (request.has_header("Transfer-Encoding")) return true;
  if (request.has_header("Content-Length"))
    return request.get_header_value_count("Content-Length") > 1 ||
           request.get_header_value("Content-Length") != "0";
  return request.method != "GET" && request.method != "HEAD";
}

}  // namespace abbe::web

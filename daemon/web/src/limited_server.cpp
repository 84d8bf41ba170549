#include "limited_server.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <utility>

namespace abbe::web {

LimitedServer::LimitedServer(TlsContext tls, ConnectionLimits limits,
                             std::function<void(const std::string&, const std::string&)> report)
    : tls_(std::move(tls)), limits_(limits), report_(std::move(report)) {}

void LimitedServer::let_more_connections_wait() {
  constexpr int kWaiting = 128;
  (void)::listen(svr_sock_, kWaiting);
}

bool LimitedServer::process_and_close_socket(socket_t fd) {
  (void)::fcntl(fd, F_SETFD, FD_CLOEXEC);
  {
    ConnectionStream stream(fd, tls_.get(), limits_,
                            [this] { return svr_sock_ == INVALID_SOCKET; });
    std::string address;
    int port = 0;
    stream.get_remote_ip_and_port(address, port);
    if (enter(address)) {
      if (!tls_ || stream.accept()) serve(stream);
      report_fault(stream, address);
      leave(address);
    }
  }
  (void)::shutdown(fd, SHUT_RDWR);
  (void)::close(fd);
  return true;
}

void LimitedServer::serve(ConnectionStream& stream) {
  for (std::size_t n = 1; n <= kRequestsOfConnection; ++n) {
    if (!stream.wait_for_request(kBetweenRequests)) return;
    stream.begin_request();
    bool closed = false, with_body = false;
    const bool served = process_request(
        stream, n == kRequestsOfConnection, closed, [&with_body](httplib::Request& request) {
          request.ranges.clear();
          with_body = request.method != "GET" && request.method != "HEAD";
        });
    if (!served || closed || with_body) return;
  }
}

void LimitedServer::report_fault(const ConnectionStream& stream, const std::string& address) {
  if (stream.fault() == ConnectionStream::Fault::TooLarge)
    report_("large " + address, fmt::format("{}: a request of more than {} bytes: closed", address,
                                            limits_.request_bytes));
  if (stream.fault() == ConnectionStream::Fault::TooSlow)
    report_("slow " + address, fmt::format("{}: a request took longer than {} ms: closed", address,
                                           limits_.request_time.count()));
}

bool LimitedServer::enter(const std::string& address) {
  {
    const std::lock_guard lock(mutex_);
    std::size_t& open = connections_[address];
    if (open < kConnectionsOfAddress) {
      ++open;
      return true;
    }
  }
  report_("connections " + address,
          fmt::format("{}: more than {} connections: closed", address, kConnectionsOfAddress));
  return false;
}

void LimitedServer::leave(const std::string& address) {
  const std::lock_guard lock(mutex_);
  const auto open = connections_.find(address);
  if (open != connections_.end() && --open->second == 0) connections_.erase(open);
}

}  // namespace abbe::web

#pragma once
/// A receiver of webhooks on a loopback port, and one that accepts connections and never answers.

#include <httplib.h>

#undef _res  // a macro of resolv.h, which changes headers of Eigen

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace abbe::test {

class WebhookServer {
 public:
  struct Request {
    httplib::Headers headers;
    std::string body;
  };

  WebhookServer() : WebhookServer(std::make_unique<httplib::Server>()) {}
  /// For example an httplib::SSLServer.
  explicit WebhookServer(std::unique_ptr<httplib::Server> server) : server_(std::move(server)) {
    server_->Post("/hook", [this](const httplib::Request& request, httplib::Response& response) {
      const std::lock_guard lock(mutex_);
      requests_.push_back({request.headers, request.body});
      response.status = requests_.size() <= refusals_ ? refusal_ : 200;
      response.set_content("seen", "text/plain");
      changed_.notify_all();
    });
    server_->Post("/moved", [](const httplib::Request&, httplib::Response& response) {
      response.set_redirect("/hook", 307);
    });
    port_ = server_->bind_to_any_port("127.0.0.1");
    thread_ = std::thread([this] { server_->listen_after_bind(); });
  }
  WebhookServer(const WebhookServer&) = delete;
  WebhookServer& operator=(const WebhookServer&) = delete;
  ~WebhookServer() {
    while (!server_->is_running()) std::this_thread::yield();  // stop() before it has no effect
    server_->stop();
    thread_.join();
  }

  /// The next `count` requests get `status`.
  void refuse(std::size_t count, int status) {
    const std::lock_guard lock(mutex_);
    refusals_ = requests_.size() + count;
    refusal_ = status;
  }
  [[nodiscard]] std::string url(const std::string& path = "/hook",
                                const std::string& scheme = "http") const {
    return scheme + "://127.0.0.1:" + std::to_string(port_) + path;
  }
  /// False if fewer arrive within half a minute.
  [[nodiscard]] bool wait_for(std::size_t requests) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds{30},
                             [&] { return requests_.size() >= requests; });
  }
  [[nodiscard]] std::vector<Request> requests() const {
    const std::lock_guard lock(mutex_);
    return requests_;
  }
  [[nodiscard]] nlohmann::json json(std::size_t index) const {
    return nlohmann::json::parse(requests().at(index).body);
  }

 private:
  std::unique_ptr<httplib::Server> server_;
  int port_ = 0;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Request> requests_;
  std::size_t refusals_ = 0;
  int refusal_ = 500;
  std::thread thread_;
};

/// The kernel accepts connections for it; nothing reads them.
class HangingServer {
 public:
  HangingServer() : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* const generic = reinterpret_cast<sockaddr*>(&address);  // as the socket API requires
    (void)::bind(fd_, generic, size);
    (void)::listen(fd_, 16);
    (void)::getsockname(fd_, generic, &size);
    port_ = ntohs(address.sin_port);
  }
  HangingServer(const HangingServer&) = delete;
  HangingServer& operator=(const HangingServer&) = delete;
  ~HangingServer() { ::close(fd_); }

  [[nodiscard]] std::string at(const std::string& scheme) const {
    return scheme + "://127.0.0.1:" + std::to_string(port_);
  }

 private:
  int fd_;
  int port_ = 0;
};

}  // namespace abbe::test

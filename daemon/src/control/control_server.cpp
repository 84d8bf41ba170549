#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <list>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "abbe/daemon/control_protocol.hpp"
#include "control/unix_socket.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

constexpr std::size_t kLongestRequest = 4u << 20;  // a path of 10^5 vertices fits; more is not a request
constexpr int kMostClients = 32;

struct Client {
  FileDescriptor fd;
  std::string inbox;
  std::string outbox;
};

class Server final : public ControlServer {
 public:
  Server(FileDescriptor listener, FileDescriptor wake, std::filesystem::path path, Handler handler)
      : listener_(std::move(listener)),
        wake_(std::move(wake)),
        path_(std::move(path)),
        handler_(std::move(handler)) {
    thread_ = std::thread([this] {
      try {
        serve();
      } catch (const std::exception& defect) {  // nobody is answered any more; everything else goes on
        fmt::print(stderr, "abbed: the control socket ended by a defect: {}\n", defect.what());
      }
    });
  }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  ~Server() override {
    const std::uint64_t one = 1;
    (void)!::write(wake_.get(), &one, sizeof one);
    thread_.join();
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }

 private:
  void serve() {
    for (;;) {
      std::vector<pollfd> waits{{wake_.get(), POLLIN, 0}, {listener_.get(), POLLIN, 0}};
      for (const Client& c : clients_) {
        waits.push_back({c.fd.get(), static_cast<short>(c.outbox.empty() ? POLLIN : POLLIN | POLLOUT), 0});
      }
      if (::poll(waits.data(), waits.size(), -1) < 0 && errno != EINTR) return;
      if (waits[0].revents != 0) return;
      std::size_t i = 2;
      for (auto c = clients_.begin(); c != clients_.end(); ++i) {
        const bool alive = waits[i].revents == 0 || turn(*c);
        c = alive ? std::next(c) : clients_.erase(c);
      }
      if ((waits[1].revents & POLLIN) != 0) accept_one();
    }
  }

  void accept_one() {
    FileDescriptor fd{::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK)};
    if (fd && clients_.size() < kMostClients) clients_.push_back({std::move(fd), {}, {}});
  }

  /// False when the client is gone or misbehaves.
  bool turn(Client& c) {
    std::array<char, 65536> buffer;  // NOLINT: read() fills what is used
    for (;;) {
      const ssize_t n = ::read(c.fd.get(), buffer.data(), buffer.size());
      if (n == 0) return false;
      if (n < 0) {
        if (errno == EAGAIN) break;
        if (errno == EINTR) continue;
        return false;
      }
      c.inbox.append(buffer.data(), static_cast<std::size_t>(n));
      if (c.inbox.size() > kLongestRequest) return false;
    }
    for (std::size_t end = c.inbox.find('\n'); end != std::string::npos; end = c.inbox.find('\n')) {
      c.outbox += answer(c.inbox.substr(0, end)).dump() + '\n';
      c.inbox.erase(0, end + 1);
    }
    return flush(c);
  }

  static bool flush(Client& c) {
    while (!c.outbox.empty()) {
      const ssize_t n = ::send(c.fd.get(), c.outbox.data(), c.outbox.size(), MSG_NOSIGNAL);
      if (n < 0) return errno == EAGAIN || errno == EINTR;
      c.outbox.erase(0, static_cast<std::size_t>(n));
    }
    return true;
  }

  json answer(const std::string& line) {
    const json request = json::parse(line, nullptr, /*allow_exceptions=*/false);
    if (!request.is_object() || !request.contains("do") || !request["do"].is_string()) {
      return refusal({ErrorCode::Usage, R"(expected one JSON object a line with a string member "do")"});
    }
    try {
      return handler_(request);
    } catch (const std::exception& e) {  // a member of the wrong type, as nlohmann::json says it
      return refusal(
          {ErrorCode::Usage, fmt::format("request \"{}\": {}", request["do"].get<std::string>(), e.what())});
    }
  }

  FileDescriptor listener_;
  FileDescriptor wake_;
  std::filesystem::path path_;
  Handler handler_;
  std::list<Client> clients_;
  std::thread thread_;
};

}  // namespace

Result<std::unique_ptr<ControlServer>> ControlServer::open(const std::filesystem::path& socket_path,
                                                           Handler handler) {
  auto listener = listen_unix(socket_path);
  if (!listener) return tl::unexpected(listener.error());
  FileDescriptor wake{::eventfd(0, EFD_CLOEXEC)};
  return std::make_unique<Server>(std::move(*listener), std::move(wake), socket_path, std::move(handler));
}

}  // namespace abbe::daemon

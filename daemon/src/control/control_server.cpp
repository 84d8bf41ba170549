#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <pwd.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <list>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "abbe/daemon/control_protocol.hpp"
#include "control/control_server.hpp"
#include "control/json_line.hpp"
#include "control/unix_socket.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

constexpr std::size_t kLongestRequest = 4u << 20;  // a path of 10^5 vertices fits; more is not a request
constexpr std::size_t kMostUnread = 1u << 20;      // of answers; a client that reads none gets no more
constexpr int kMostClients = 32;
constexpr auto kRest = std::chrono::milliseconds{200};  // without descriptors for a newcomer

struct Client {
  FileDescriptor fd;
  std::string user;  ///< as the kernel knows the process at the other end
  std::string inbox;
  std::string outbox;

  [[nodiscard]] bool asks() const { return inbox.find('\n') != std::string::npos; }
  [[nodiscard]] bool may_be_answered() const { return outbox.size() < kMostUnread; }
};

std::string user_at(int fd) {
  ucred peer{};
  socklen_t size = sizeof peer;
  if (::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return "somebody";
  passwd entry{};
  passwd* found = nullptr;
  std::array<char, 16384> strings;  // NOLINT: getpwuid_r() fills what is used
  ::getpwuid_r(peer.uid, &entry, strings.data(), strings.size(), &found);
  return found != nullptr ? found->pw_name : fmt::format("uid {}", peer.uid);
}

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
  using Clock = std::chrono::steady_clock;

  void serve() {
    for (;;) {
      // The listener stays readable while a newcomer cannot be taken: a descriptor of -1 is not looked at.
      const auto rest = std::chrono::ceil<std::chrono::milliseconds>(rest_until_ - Clock::now()).count();
      std::vector<pollfd> waits{{wake_.get(), POLLIN, 0}, {rest > 0 ? -1 : listener_.get(), POLLIN, 0}};
      int time_out_ms = rest > 0 ? static_cast<int>(rest) : -1;
      for (const Client& c : clients_) {
        waits.push_back({c.fd.get(), events_of(c), 0});
        if (c.asks() && c.may_be_answered()) time_out_ms = 0;
      }
      if (::poll(waits.data(), waits.size(), time_out_ms) < 0 && errno != EINTR) return;
      if (waits[0].revents != 0) return;
      std::size_t i = 2;
      for (auto c = clients_.begin(); c != clients_.end(); ++i)
        c = turn(*c, waits[i].revents) ? std::next(c) : clients_.erase(c);
      if ((waits[1].revents & POLLIN) != 0) accept_one();
    }
  }

  /// What was asked is answered before more is read.
  static short events_of(const Client& c) {
    return static_cast<short>((c.asks() ? 0 : POLLIN) | (c.outbox.empty() ? 0 : POLLOUT));
  }

  void accept_one() {
    FileDescriptor fd{::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK)};
    if (!fd && errno != EAGAIN && errno != EINTR && errno != ECONNABORTED) rest_until_ = Clock::now() + kRest;
    if (!fd || clients_.size() >= kMostClients) return;
    std::string user = user_at(fd.get());
    clients_.push_back({.fd = std::move(fd), .user = std::move(user)});
  }

  /// One answer a turn, so that nobody waits for a client that asks much. False when the client is gone or
  /// misbehaves.
  bool turn(Client& c, short revents) {
    if (!c.asks() && revents != 0 && !read(c)) return false;
    if (c.asks() && c.may_be_answered()) {
      const std::size_t end = c.inbox.find('\n');
      c.outbox += line_of(answer(c.inbox.substr(0, end), c.user));
      c.inbox.erase(0, end + 1);
    }
    return flush(c);
  }

  static bool read(Client& c) {
    std::array<char, 65536> buffer;  // NOLINT: read() fills what is used
    const ssize_t n = ::read(c.fd.get(), buffer.data(), buffer.size());
    if (n < 0) return errno == EAGAIN || errno == EINTR;
    c.inbox.append(buffer.data(), static_cast<std::size_t>(n));
    return n > 0 && c.inbox.size() <= kLongestRequest;
  }

  static bool flush(Client& c) {
    while (!c.outbox.empty()) {
      const ssize_t n = ::send(c.fd.get(), c.outbox.data(), c.outbox.size(), MSG_NOSIGNAL);
      if (n < 0) return errno == EAGAIN || errno == EINTR;
      c.outbox.erase(0, static_cast<std::size_t>(n));
    }
    return true;
  }

  json answer(const std::string& line, const std::string& user) {
    json request = json::parse(line, nullptr, /*allow_exceptions=*/false);
    if (!request.is_object() || !request.contains("do") || !request["do"].is_string()) {
      return refusal({ErrorCode::Usage, R"(expected one JSON object a line with a string member "do")"});
    }
    request["user"] = user;  // whatever the client said there
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
  Clock::time_point rest_until_{};
  std::thread thread_;
};

}  // namespace

std::unique_ptr<ControlServer> serve_control(FileDescriptor listener, const std::filesystem::path& path,
                                             ControlServer::Handler handler) {
  FileDescriptor wake{::eventfd(0, EFD_CLOEXEC)};
  return std::make_unique<Server>(std::move(listener), std::move(wake), path, std::move(handler));
}

Result<std::unique_ptr<ControlServer>> ControlServer::open(const std::filesystem::path& socket_path,
                                                           Handler handler) {
  auto listener = listen_unix(socket_path);
  if (!listener) return tl::unexpected(listener.error());
  return serve_control(std::move(*listener), socket_path, std::move(handler));
}

}  // namespace abbe::daemon

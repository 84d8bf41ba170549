#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <pwd.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <list>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/control_protocol.hpp"
#include "abbe/base/control_server.hpp"
#include "abbe/base/unix_socket.hpp"
#include "json_line.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

constexpr std::size_t kMostUnread = 1u << 20;  // of answers; a client that reads none gets no more
constexpr auto kRest = std::chrono::milliseconds{200};  // without descriptors for a newcomer
constexpr int kNewcomersAtOnce = 16;

using Clock = std::chrono::steady_clock;

struct Client {
  FileDescriptor fd;
  ControlPeer peer;
  Clock::time_point active;  ///< when a byte last came or left
  std::string inbox = {};
  std::string outbox = {};

  [[nodiscard]] bool asks() const { return inbox.find('\n') != std::string::npos; }
  [[nodiscard]] bool may_be_answered() const { return outbox.size() < kMostUnread; }
};

std::string name_of(uid_t uid) {
  passwd entry{};
  passwd* found = nullptr;
  std::array<char, 16384> strings;  // NOLINT: getpwuid_r() fills what is used
  ::getpwuid_r(uid, &entry, strings.data(), strings.size(), &found);
  return found != nullptr ? found->pw_name : fmt::format("uid {}", uid);
}

/// socket(7): SO_PEERGROUPS says by ERANGE how many there are. A kernel that does not know it:
/// none.
std::vector<gid_t> supplementary_groups_at(int fd) {
  std::vector<gid_t> groups(64);
  for (;;) {
    auto size = static_cast<socklen_t>(groups.size() * sizeof(gid_t));
    if (::getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &size) == 0) {
      groups.resize(size / sizeof(gid_t));
      return groups;
    }
    if (errno != ERANGE || size / sizeof(gid_t) <= groups.size()) return {};
    groups.resize(size / sizeof(gid_t));
  }
}

ControlPeer peer_at(int fd) {
  ucred credentials{};
  socklen_t size = sizeof credentials;
  if (::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) return {};
  ControlPeer peer{.user = name_of(credentials.uid),
                   .uid = credentials.uid,
                   .groups = supplementary_groups_at(fd)};
  peer.groups.push_back(credentials.gid);
  return peer;
}

class Server final : public ControlServer {
 public:
  Server(FileDescriptor listener, FileDescriptor wake, std::filesystem::path path, Handler handler,
         const ControlLimits& limits)
      : limits_(limits),
        listener_(std::move(listener)),
        wake_(std::move(wake)),
        path_(std::move(path)),
        handler_(std::move(handler)) {
    thread_ = std::thread([this] {
      try {
        serve();
      } catch (
          const std::exception& defect) {  // nobody is answered any more; everything else goes on
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
      const auto now = Clock::now();
      // The listener stays readable while a newcomer cannot be taken: a descriptor of -1 is not
      // looked at.
      const bool rests = rest_until_ > now;
      std::vector<pollfd> waits{{wake_.get(), POLLIN, 0},
                                {rests ? -1 : listener_.get(), POLLIN, 0}};
      for (const Client& c : clients_) waits.push_back({c.fd.get(), events_of(c), 0});
      if (::poll(waits.data(), waits.size(), time_out_ms(now)) < 0 && errno != EINTR) return;
      if (waits[0].revents != 0) return;
      std::size_t i = 2;
      for (auto c = clients_.begin(); c != clients_.end(); ++i)
        c = cycle(*c, waits[i].revents) ? std::next(c) : clients_.erase(c);
      close_idle(Clock::now());
      if ((waits[1].revents & POLLIN) != 0) accept_some();
    }
  }

  /// Until a client has to be closed or a newcomer may be taken; -1: for ever.
  [[nodiscard]] int time_out_ms(Clock::time_point now) const {
    auto until = rest_until_ > now ? rest_until_ : Clock::time_point::max();
    for (const Client& c : clients_) {
      if (c.asks() && c.may_be_answered()) return 0;
      until = std::min(until, c.active + limits_.idle);
    }
    if (until == Clock::time_point::max()) return -1;
    return static_cast<int>(std::max<std::int64_t>(
        0, std::chrono::ceil<std::chrono::milliseconds>(until - now).count()));
  }

  /// What was asked is answered before more is read.
  static short events_of(const Client& c) {
    return static_cast<short>((c.asks() ? 0 : POLLIN) | (c.outbox.empty() ? 0 : POLLOUT));
  }

  void accept_some() {
    for (int i = 0; i < kNewcomersAtOnce; ++i) {
      FileDescriptor fd{::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK)};
      if (!fd) {
        if (errno != EAGAIN && errno != EINTR && errno != ECONNABORTED)
          rest_until_ = Clock::now() + kRest;
        return;
      }
      ControlPeer peer = peer_at(fd.get());
      make_place_for(peer.uid);
      clients_.push_back({.fd = std::move(fd), .peer = std::move(peer), .active = Clock::now()});
    }
  }

  [[nodiscard]] std::size_t connections_of(uid_t uid) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(clients_, [uid](const Client& c) { return c.peer.uid == uid; }));
  }

  void make_place_for(uid_t newcomer) {
    if (connections_of(newcomer) >= limits_.of_one_user) {
      close_oldest_of(newcomer);
    } else if (clients_.size() >= limits_.connections) {
      const auto most = std::ranges::max_element(
          clients_, {}, [this](const Client& c) { return connections_of(c.peer.uid); });
      close_oldest_of(most->peer.uid);
    }
  }

  void close_oldest_of(uid_t uid) {
    auto oldest = clients_.end();
    for (auto c = clients_.begin(); c != clients_.end(); ++c)
      if (c->peer.uid == uid && (oldest == clients_.end() || c->active < oldest->active))
        oldest = c;
    if (oldest == clients_.end()) return;
    say_goodbye(*oldest,
                fmt::format("closed for a newer connection: at most {} are open, {} of one user",
                            limits_.connections, limits_.of_one_user));
    clients_.erase(oldest);
  }

  void close_idle(Clock::time_point now) {
    std::erase_if(clients_, [&](const Client& c) {
      if (now - c.active < limits_.idle) return false;
      say_goodbye(c, fmt::format("closed: idle for {} ms", limits_.idle.count()));
      return true;
    });
  }

  /// A whole line or nothing: answers that were not read are not torn.
  static void say_goodbye(const Client& c, std::string why) {
    if (!c.outbox.empty()) return;
    const std::string line =
        line_of(refusal({ErrorCode::Refused, "control socket: " + std::move(why)}));
    (void)!::send(c.fd.get(), line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }

  /// One answer a turn, so that nobody waits for a client that asks much. False when the client is
  /// gone or misbehaves.
  bool cycle(Client& c, short revents) {
    if (!c.asks() && revents != 0 && !read(c)) return false;
    if (c.asks() && c.may_be_answered()) {
      const std::size_t end = c.inbox.find('\n');
      c.outbox += line_of(answer(c.inbox.substr(0, end), c.peer));
      c.active = Clock::now();
      c.inbox.erase(0, end + 1);
    }
    return flush(c);
  }

  static bool read(Client& c) {
    std::array<char, 65536> buffer;  // NOLINT: read() fills what is used
    const ssize_t n = ::read(c.fd.get(), buffer.data(), buffer.size());
    if (n < 0) return errno == EAGAIN || errno == EINTR;
    c.inbox.append(buffer.data(), static_cast<std::size_t>(n));
    c.active = Clock::now();
    return n > 0 && c.inbox.size() <= kRequestBounds.bytes;
  }

  static bool flush(Client& c) {
    while (!c.outbox.empty()) {
      const ssize_t n = ::send(c.fd.get(), c.outbox.data(), c.outbox.size(), MSG_NOSIGNAL);
      if (n < 0) return errno == EAGAIN || errno == EINTR;
      c.outbox.erase(0, static_cast<std::size_t>(n));
      c.active = Clock::now();
    }
    return true;
  }

  json answer(const std::string& line, const ControlPeer& peer) {
    auto parsed = parse_json(line, "request", kRequestBounds);
    if (!parsed) return refusal({ErrorCode::Usage, parsed.error().text});
    json& request = *parsed;
    if (!request.is_object() || !request.contains("do") || !request["do"].is_string()) {
      return refusal(
          {ErrorCode::Usage, R"(expected one JSON object a line with a string member "do")"});
    }
    request["user"] = peer.user;  // whatever the client said there
    try {
      return handler_(request, peer);
    } catch (const std::exception& e) {  // a member of the wrong type, as nlohmann::json says it
      return refusal({ErrorCode::Usage, fmt::format("request \"{}\": {}",
                                                    request["do"].get<std::string>(), e.what())});
    }
  }

  ControlLimits limits_;
  FileDescriptor listener_;
  FileDescriptor wake_;
  std::filesystem::path path_;
  Handler handler_;
  std::list<Client> clients_;
  Clock::time_point rest_until_{};
  std::thread thread_;
};

}  // namespace

std::unique_ptr<ControlServer> serve_control(FileDescriptor listener,
                                             const std::filesystem::path& path,
                                             ControlServer::Handler handler,
                                             const ControlLimits& limits) {
  FileDescriptor wake{::eventfd(0, EFD_CLOEXEC)};
  return std::make_unique<Server>(std::move(listener), std::move(wake), path, std::move(handler),
                                  limits);
}

Result<std::unique_ptr<ControlServer>> ControlServer::open(const std::filesystem::path& socket_path,
                                                           Handler handler,
                                                           const ControlLimits& limits) {
  auto listener = listen_unix(socket_path);
  if (!listener) return tl::unexpected(listener.error());
  return serve_control(std::move(*listener), socket_path, std::move(handler), limits);
}

}  // namespace abbe::daemon

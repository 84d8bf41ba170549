#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
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
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "abbe/base/account_names.hpp"
#include "abbe/base/bounded_json.hpp"
#include "abbe/base/control_protocol.hpp"
#include "abbe/base/control_server.hpp"
#include "abbe/base/unix_socket.hpp"
#include "abbe/result/try.hpp"
#include "json_line.hpp"
#include "long_requests.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

// Most bytes of answers that may wait for a client to read them. While more wait, the next requests
// of this client are not answered.
constexpr std::size_t kMostUnread = 1u << 20;
// Pause before the next accept() when no file descriptors are left.
constexpr auto kAcceptPause = std::chrono::milliseconds{200};
// Pause after a cycle that failed, for example for lack of memory.
constexpr auto kPauseAfterFault = std::chrono::milliseconds{20};
constexpr auto kFaultPeriod = std::chrono::minutes{1};
constexpr int kAcceptsPerCycle = 16;
constexpr std::size_t kLongRequest = 1u << 16;  ///< bytes; answered by LongRequests

using Clock = std::chrono::steady_clock;

struct Client {
  std::uint64_t number;
  FileDescriptor fd;
  ControlPeer peer;
  Clock::time_point active;  ///< time of the last received or sent byte
  std::string inbox = {};
  std::string outbox = {};
  bool long_request = false;  ///< a long request is being answered; the next request waits

  [[nodiscard]] bool has_request() const { return inbox.find('\n') != std::string::npos; }
  [[nodiscard]] bool may_be_answered() const {
    return outbox.size() < kMostUnread && !long_request;
  }
};

/// Groups of the process at the other end (SO_PEERGROUPS, socket(7)). The call fails with ERANGE
/// and reports the required size if the buffer is too small. An empty list if the kernel does not
/// support this option.
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
  ControlPeer peer{.user = account_names().user(credentials.uid),
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
    thread_ = std::thread([this] { serve_always(); });
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
  /// Runs cycles forever. An exception (no memory) ends only its cause: one request, one
  /// connection, or one cycle. It must never end the server, because the socket is needed to stop
  /// the machine.
  void serve_always() noexcept {
    for (;;) {
      try {
        return serve();
      } catch (...) {
        report_exception();
      }
      std::this_thread::sleep_for(kPauseAfterFault);
    }
  }

  /// Reports the exception that is being handled.
  void report_exception() noexcept {
    try {
      throw;
    } catch (const std::exception& error) {
      report(error.what());
    } catch (...) {
      report("an exception not derived from std::exception");
    }
  }

  /// Reports a fault, at most one line in kFaultPeriod. Needs no memory.
  void report(const char* what) noexcept {
    const auto now = Clock::now();
    if (now < next_report_.load()) return;
    next_report_ = now + kFaultPeriod;
    std::fprintf(stderr, "abbed: control socket: internal error: %s; the other requests go on\n",
                 what);
  }

  void serve() {
    for (;;) {
      const auto now = Clock::now();

      // While accept() is paused the listener would stay readable, so that poll() would return at
      // once. Therefore its descriptor is replaced by -1, which poll() ignores.
      const bool accept_paused = accept_paused_until_ > now;
      std::vector<pollfd> waits{{wake_.get(), POLLIN, 0},
                                {accept_paused ? -1 : listener_.get(), POLLIN, 0},
                                {long_done_.get(), POLLIN, 0}};
      for (const Client& c : clients_) waits.push_back({c.fd.get(), events_of(c), 0});

      if (::poll(waits.data(), waits.size(), time_out_ms(now)) < 0 && errno != EINTR)
        throw std::system_error(errno, std::generic_category(), "poll");  // ENOMEM
      if (waits[0].revents != 0) return;

      if (waits[2].revents != 0) take_long_answers();
      std::size_t i = 3;
      for (auto c = clients_.begin(); c != clients_.end(); ++i)
        c = cycle_alone(*c, waits[i].revents) ? std::next(c) : erase(c);
      close_idle(Clock::now());
      if ((waits[1].revents & POLLIN) != 0) accept_some();
    }
  }

  /// Time until an idle client must be closed or accept() resumes; -1: no limit.
  [[nodiscard]] int time_out_ms(Clock::time_point now) const {
    auto until = accept_paused_until_ > now ? accept_paused_until_ : Clock::time_point::max();
    for (const Client& c : clients_) {
      if (c.has_request() && c.may_be_answered()) return 0;
      if (c.long_request) continue;
      until = std::min(until, c.active + limits_.idle);
    }
    if (until == Clock::time_point::max()) return -1;
    return static_cast<int>(std::max<std::int64_t>(
        0, std::chrono::ceil<std::chrono::milliseconds>(until - now).count()));
  }

  /// Events to wait for at a client's socket. While a complete request of the client waits for its
  /// answer, nothing more is read from the client.
  static short events_of(const Client& c) {
    const bool reads = !c.has_request() && !c.long_request;
    return static_cast<short>((reads ? POLLIN : 0) | (c.outbox.empty() ? 0 : POLLOUT));
  }

  void take_long_answers() {
    std::uint64_t count = 0;
    (void)!::read(long_done_.get(), &count, sizeof count);
    for (LongRequests::Job& done : long_.answered()) {
      const auto c = std::ranges::find(clients_, done.client, &Client::number);
      if (c == clients_.end()) continue;  // the client has disconnected
      c->outbox += done.line;
      c->long_request = false;
      c->active = Clock::now();
    }
  }

  void accept_some() {
    for (int i = 0; i < kAcceptsPerCycle; ++i) {
      FileDescriptor fd{::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK)};
      if (!fd) {
        if (errno != EAGAIN && errno != EINTR && errno != ECONNABORTED)
          accept_paused_until_ = Clock::now() + kAcceptPause;
        return;
      }
      ControlPeer peer = peer_at(fd.get());
      make_place_for(peer.uid);
      clients_.push_back({.number = ++last_number_,
                          .fd = std::move(fd),
                          .peer = std::move(peer),
                          .active = Clock::now()});
    }
  }

  [[nodiscard]] std::size_t connections_of(uid_t uid) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(clients_, [uid](const Client& c) { return c.peer.uid == uid; }));
  }

  void make_place_for(uid_t user) {
    if (connections_of(user) >= limits_.of_one_user) {
      close_longest_idle_of(user);
    } else if (clients_.size() >= limits_.connections) {
      const auto most = std::ranges::max_element(
          clients_, {}, [this](const Client& c) { return connections_of(c.peer.uid); });
      close_longest_idle_of(most->peer.uid);
    }
  }

  void close_longest_idle_of(uid_t uid) {
    auto longest_idle = clients_.end();
    for (auto c = clients_.begin(); c != clients_.end(); ++c)
      if (c->peer.uid == uid &&
          (longest_idle == clients_.end() || c->active < longest_idle->active))
        longest_idle = c;
    if (longest_idle == clients_.end()) return;
    send_closing_line(
        *longest_idle,
        fmt::format("closed for a newer connection: at most {} are open, {} of one user",
                    limits_.connections, limits_.of_one_user));
    erase(longest_idle);
  }

  std::list<Client>::iterator erase(std::list<Client>::iterator c) {
    if (c->long_request) long_.forget(c->number);
    return clients_.erase(c);
  }

  void close_idle(Clock::time_point now) {
    std::erase_if(clients_, [&](const Client& c) {
      if (now - c.active < limits_.idle || c.long_request) return false;
      send_closing_line(c, fmt::format("closed: idle for {} ms", limits_.idle.count()));
      return true;
    });
  }

  /// Sends a whole line or nothing: the line must not follow a partly sent answer.
  static void send_closing_line(const Client& c, std::string why) {
    if (!c.outbox.empty()) return;
    const std::string line =
        line_of(refusal({ErrorCode::Refused, "control socket: " + std::move(why)}));
    send_now(c, line);
  }

  /// Same as cycle(), but a client whose cycle throws an exception is disconnected.
  bool cycle_alone(Client& c, short revents) noexcept {
    try {
      return cycle(c, revents);
    } catch (...) {
      report_exception();
      if (c.outbox.empty()) send_now(c, failed_line_);
      return false;
    }
  }

  /// Sends the whole line or nothing. Allocates no memory.
  static void send_now(const Client& c, const std::string& line) noexcept {
    (void)!::send(c.fd.get(), line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }

  /// Answers at most one request per cycle, so that a client with many requests does not delay the
  /// others. False if the client disconnected or its request is too long.
  bool cycle(Client& c, short revents) {
    if (c.long_request && (revents & (POLLHUP | POLLERR)) != 0) return false;
    if (!c.has_request() && !c.long_request && revents != 0 && !read(c)) return false;
    if (c.has_request() && c.may_be_answered()) {
      const std::size_t end = c.inbox.find('\n');
      if (end < kLongRequest) {
        c.outbox += answer_line(c.inbox.substr(0, end), c.peer);
      } else {
        c.long_request = long_.take(c.number, c.inbox.substr(0, end), c.peer);
        if (!c.long_request)
          c.outbox += line_of(refusal({ErrorCode::Refused,
                                       "control socket: other long requests are waiting for their "
                                       "answers: send this one again later"}));
      }
      c.active = Clock::now();
      c.inbox.erase(0, end + 1);
    }
    return flush(c);
  }

  /// False if the client disconnected or its request is longer than the limit.
  static bool read(Client& c) {
    std::array<char, 65536> buffer;  // NOLINT: read() fills what is used
    const ssize_t n = ::read(c.fd.get(), buffer.data(), buffer.size());
    if (n < 0) return errno == EAGAIN || errno == EINTR;
    c.inbox.append(buffer.data(), static_cast<std::size_t>(n));
    c.active = Clock::now();
    if (c.inbox.size() <= kRequestBounds.bytes) return n > 0;

    send_closing_line(c, fmt::format("closed: the request is longer than {} bytes, the limit",
                                     kRequestBounds.bytes));
    return false;
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

  /// The answer to a request. An answer that reports a lack of memory needs no memory.
  std::string answer_line(const std::string& line, const ControlPeer& peer) {
    try {
      return line_of(answer(line, peer));
    } catch (...) {
      report_exception();
      return failed_line_;
    }
  }

  json answer(const std::string& line, const ControlPeer& peer) {
    auto parsed = parse_json(line, "request", kRequestBounds);
    if (!parsed) return refusal({ErrorCode::Usage, parsed.error().text});
    json& request = *parsed;
    if (!request.is_object() || !request.contains("do") || !request["do"].is_string()) {
      return refusal(
          {ErrorCode::Usage, R"(expected one JSON object per line with a string member "do")"});
    }
    request["user"] = peer.user;  // overwrites a "user" sent by the client
    try {
      return handler_(request, peer);
    } catch (const nlohmann::json::exception& e) {  // a member is missing or has the wrong type
      return refusal(
          {ErrorCode::Usage,
           fmt::format("request \"{}\": {}", request["do"].get<std::string>(), cause_of(e))});
    } catch (const std::exception& e) {  // the fault is not in the request
      return refusal({ErrorCode::Io, fmt::format("request \"{}\" failed in the daemon: {}",
                                                 request["do"].get<std::string>(), e.what())});
    }
  }

  ControlLimits limits_;
  FileDescriptor listener_;
  FileDescriptor wake_;
  std::filesystem::path path_;
  Handler handler_;
  std::list<Client> clients_;
  std::uint64_t last_number_ = 0;
  Clock::time_point accept_paused_until_{};
  // atomic because both threads may report
  std::atomic<Clock::time_point> next_report_{Clock::time_point{}};
  const std::string failed_line_ = line_of(refusal(
      {ErrorCode::Io,
       "control socket: the request failed in the daemon: internal error, or not enough memory"}));
  FileDescriptor long_done_{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
  LongRequests long_{
      [this](const std::string& line, const ControlPeer& peer) { return answer_line(line, peer); },
      long_done_.get()};
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
  ABBE_TRY(listener);
  return serve_control(std::move(*listener), socket_path, std::move(handler), limits);
}

}  // namespace abbe::daemon

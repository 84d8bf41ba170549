#include "abbe/mtconnect/shdr_server.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>
#include <vector>

#include "abbe/result/try.hpp"
#include "tcp_socket.hpp"

namespace abbe::mtconnect {
namespace {

using namespace std::chrono_literals;
using daemon::FileDescriptor;

constexpr int kAcceptsPerCycle = 16;
// Pause before the next accept() when no file descriptors are left.
constexpr auto kAcceptPause = 200ms;
// Longest line of a client. The longest that an agent sends has 7 bytes.
constexpr std::size_t kLongestLine = 1024;

std::string_view without_spaces(std::string_view line) {
  const auto first = line.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return line.substr(first, line.find_last_not_of(" \t\r") - first + 1);
}

}  // namespace

ShdrServer::ShdrServer(ShdrServerOptions options, Greeting greeting, Log log,
                       FileDescriptor listener, std::uint16_t port)
    : options_(std::move(options)),
      greeting_(std::move(greeting)),
      log_(std::move(log)),
      listener_(std::move(listener)),
      port_(port) {}

daemon::Result<ShdrServer> ShdrServer::listen(ShdrServerOptions options, Greeting greeting,
                                              Log log) {
  auto listener = listen_tcp(options.address, options.port);
  ABBE_TRY(listener);
  const std::uint16_t port = local_port(listener->get());
  return ShdrServer{std::move(options), std::move(greeting), std::move(log), std::move(*listener),
                    port};
}

void ShdrServer::cycle(std::chrono::milliseconds at_most, int wake) {
  // A descriptor of -1 is ignored by poll(): while accept() is paused, the listener would stay
  // readable.
  const bool accept_paused = accept_paused_until_ > Clock::now();
  std::vector<pollfd> waits{{wake, POLLIN, 0}, {accept_paused ? -1 : listener_.get(), POLLIN, 0}};
  for (const Client& client : clients_)
    waits.push_back(
        {client.fd.get(), static_cast<short>(POLLIN | (client.outbox.empty() ? 0 : POLLOUT)), 0});
  if (::poll(waits.data(), waits.size(), static_cast<int>(at_most.count())) < 0) return;

  const auto now = Clock::now();
  std::size_t i = 2;
  for (Client& client : clients_) {
    if (waits[i++].revents != 0) read(client, now);
    flush(client, now);
    check(client, now);
  }
  disconnect_faulty();
  if ((waits[1].revents & POLLIN) != 0) accept_some(now);
}

void ShdrServer::send(std::string_view lines) {
  const auto now = Clock::now();
  for (Client& client : clients_) {
    client.outbox += lines;
    flush(client, now);
    check(client, now);
  }
  disconnect_faulty();
}

void ShdrServer::accept_some(Clock::time_point now) {
  for (int i = 0; i < kAcceptsPerCycle; ++i) {
    Accepted accepted = accept_tcp(listener_.get(), options_.socket_buffer_bytes);
    if (!accepted.fd) {
      if (errno != EAGAIN && errno != EINTR && errno != ECONNABORTED)
        accept_paused_until_ = now + kAcceptPause;
      return;
    }
    if (clients_.size() >= options_.clients && !make_place()) {
      log_(fmt::format("client {}: refused: {} agents are connected, the limit", accepted.peer,
                       options_.clients));
      continue;
    }

    log_(fmt::format("client {}: connected", accepted.peer));
    clients_.push_back({.fd = std::move(accepted.fd),
                        .name = std::move(accepted.peer),
                        .progress = now,
                        .second_began = now,
                        .outbox = greeting_()});
    flush(clients_.back(), now);
  }
  disconnect_faulty();
}

bool ShdrServer::make_place() {
  const auto oldest = std::ranges::find(clients_, Clock::time_point{}, &Client::last_ping);
  if (oldest == clients_.end()) return false;
  oldest->fault =
      fmt::format("{} are connected, the limit, and it never sent a * PING", options_.clients);
  disconnect_faulty();
  return true;
}

/// Reads at most one buffer, so that a client that sends much does not delay the others.
void ShdrServer::read(Client& client, Clock::time_point now) {
  std::array<char, 4096> buffer;  // NOLINT: read() fills what is used
  const ssize_t n = ::read(client.fd.get(), buffer.data(), buffer.size());
  if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
  if (n <= 0) {
    client.fault = n == 0 ? "closed the connection" : std::strerror(errno);
    return;
  }

  if (now - client.second_began >= 1s) {
    client.second_began = now;
    client.received = 0;
  }
  client.received += static_cast<std::size_t>(n);
  if (client.received > options_.received_bytes_per_s) {
    client.fault = fmt::format("sends more than {} bytes in a second; an agent sends only * PING",
                               options_.received_bytes_per_s);
    return;
  }

  client.inbox.append(buffer.data(), static_cast<std::size_t>(n));
  answer_lines(client, now);
}

/// Answers "* PING"; other lines are ignored, as adapters do.
void ShdrServer::answer_lines(Client& client, Clock::time_point now) {
  std::size_t begin = 0;
  for (std::size_t end; (end = client.inbox.find('\n', begin)) != std::string::npos;
       begin = end + 1) {
    if (without_spaces(std::string_view(client.inbox).substr(begin, end - begin)) != "* PING")
      continue;
    client.last_ping = now;
    client.outbox += fmt::format("* PONG {}\n", options_.heartbeat.count());
  }

  client.inbox.erase(0, begin);
  if (client.inbox.size() > kLongestLine)
    client.fault = fmt::format("sends a line of more than {} bytes", kLongestLine);
}

void ShdrServer::flush(Client& client, Clock::time_point now) {
  while (!client.outbox.empty() && client.fault.empty()) {
    const ssize_t n =
        ::send(client.fd.get(), client.outbox.data(), client.outbox.size(), MSG_NOSIGNAL);
    if (n < 0 && errno == EAGAIN) return;
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      client.fault = std::strerror(errno);
      return;
    }
    client.outbox.erase(0, static_cast<std::size_t>(n));
    client.progress = now;
  }
  if (client.outbox.empty()) client.progress = now;
}

void ShdrServer::check(Client& client, Clock::time_point now) const {
  if (!client.fault.empty()) return;
  const auto patience = 2 * options_.heartbeat;
  const auto seconds = std::chrono::duration<double>(patience).count();

  if (client.outbox.size() > options_.unsent_bytes || now - client.progress > patience) {
    client.fault = fmt::format("does not read: {} bytes wait", client.outbox.size());
  } else if (client.last_ping != Clock::time_point{} && now - client.last_ping > patience) {
    client.fault = fmt::format("has sent no * PING for {} s", seconds);
  }
}

void ShdrServer::disconnect_faulty() {
  std::erase_if(clients_, [this](const Client& client) {
    if (client.fault.empty()) return false;
    log_(fmt::format("client {}: disconnected: {}", client.name, client.fault));
    return true;
  });
}

}  // namespace abbe::mtconnect

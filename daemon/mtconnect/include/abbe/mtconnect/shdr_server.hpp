#pragma once
/// The TCP side of the adapter: sends lines to every connected agent and answers "* PING". A client
/// that does not read, sends too much or stops its heartbeat is disconnected, with a message that
/// names its address; the others are not affected. One thread; no call blocks longer than stated.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/base/file_descriptor.hpp"

namespace abbe::mtconnect {

struct ShdrServerOptions {
  std::string address = "127.0.0.1";  ///< numeric IP address
  std::uint16_t port = 7878;          ///< 0: any free port
  std::chrono::milliseconds heartbeat = std::chrono::seconds{10};
  /// Most clients. If there are that many, a further client replaces the oldest client that never
  /// sent "* PING", because such a client is not an agent. If there is none, the further client is
  /// refused.
  std::size_t clients = 16;
  /// A client is disconnected if more than this number of bytes wait for it, or if it has read
  /// nothing for two heartbeats while bytes wait.
  std::size_t unsent_bytes = 256u << 10;
  int socket_buffer_bytes = 64 << 10;  ///< send buffer of the kernel for each client
  /// Most bytes that a client may send in one second. An agent sends 7 in each heartbeat.
  std::size_t received_bytes_per_s = 16u << 10;
};

class ShdrServer {
 public:
  using Log = std::function<void(std::string_view line)>;
  /// Returns the lines for a client that has just connected.
  using Greeting = std::function<std::string()>;
  using Clock = std::chrono::steady_clock;

  /// Usage for an address that is not numeric; Io if the address and port cannot be used, for
  /// example because another process listens there.
  [[nodiscard]] static daemon::Result<ShdrServer> listen(ShdrServerOptions options,
                                                         Greeting greeting, Log log);

  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  [[nodiscard]] std::size_t clients() const noexcept { return clients_.size(); }

  /// Serves the clients for at most `at_most`; returns earlier if `wake` becomes readable.
  void cycle(std::chrono::milliseconds at_most, int wake);
  /// Sends `lines` to every client.
  void send(std::string_view lines);

 private:
  struct Client {
    daemon::FileDescriptor fd;
    std::string name;  ///< "127.0.0.1:40312"
    /// last time at which no bytes waited for the client, or the client accepted bytes
    Clock::time_point progress;
    Clock::time_point last_ping{};   ///< zero: no ping yet
    Clock::time_point second_began;  ///< start of the second in which `received` counts
    std::size_t received = 0;        ///< bytes in this second
    std::string inbox{}, outbox{};
    std::string fault{};  ///< reason why the client must be disconnected; empty: it stays connected
  };

  ShdrServer(ShdrServerOptions options, Greeting greeting, Log log, daemon::FileDescriptor listener,
             std::uint16_t port);

  void accept_some(Clock::time_point now);
  [[nodiscard]] bool make_place();
  void read(Client& client, Clock::time_point now);
  void answer_lines(Client& client, Clock::time_point now);
  void flush(Client& client, Clock::time_point now);
  void check(Client& client, Clock::time_point now) const;
  void disconnect_faulty();

  ShdrServerOptions options_;
  Greeting greeting_;
  Log log_;
  daemon::FileDescriptor listener_;
  std::uint16_t port_;
  std::list<Client> clients_;
  Clock::time_point accept_paused_until_{};
};

}  // namespace abbe::mtconnect

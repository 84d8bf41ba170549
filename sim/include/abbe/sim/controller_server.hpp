#pragma once
/// A device controller behind a TCP port. It serves one client at a time; the connection of a
/// second client is closed (a tracker sends it an error packet before). Steppable: poll(now) never
/// blocks and reads no clock. Not thread-safe. Controllers: TrackerDevice (simulated),
/// RecordedTracker and RecordedDialogue (replayed), IppDmeDevice (a measuring machine).

#include <poll.h>

#include <cstddef>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "abbe/result/try.hpp"
#include "abbe/sim/error.hpp"
#include "abbe/sim/sim_clock.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {

template <class Controller>
class ControllerServer {
 public:
  /// Listens on 127.0.0.1; port 0: the kernel chooses the port.
  [[nodiscard]] static Result<ControllerServer> open(std::uint16_t port,
                                                     std::unique_ptr<Controller> controller) {
    auto listener = listen_tcp(port);
    ABBE_TRY(listener);
    return ControllerServer(std::move(*listener), std::move(controller));
  }

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const { return device_->next_due(); }
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] int listener_fd() const { return listener_.get(); }
  [[nodiscard]] int client_fd() const { return client_.get(); }  ///< -1 without a client
  [[nodiscard]] bool wants_write() const { return !unsent_.empty(); }
  /// From now on each poll() sends at most `bytes`, to simulate segments that arrive one by one. A
  /// caller that decides itself when to poll can delay the next segment; a loop that waits with
  /// add_poll_fds() sends it at once.
  void send_per_poll(std::size_t bytes) { most_per_poll_ = bytes; }
  /// Adds to `fds` the sockets that the caller must wait for, until next_due() at the latest.
  void add_poll_fds(std::vector<pollfd>& fds) const {
    add_server_fds(listener_, client_, wants_write(), fds);
  }
  [[nodiscard]] Controller& device() { return *device_; }
  [[nodiscard]] const Controller& device() const { return *device_; }

 private:
  ControllerServer(Socket listener, std::unique_ptr<Controller> device)
      : listener_(std::move(listener)), port_(port_of(listener_)), device_(std::move(device)) {}

  void accept_clients(HostTime now);
  void read(HostTime now);
  void write();
  void drop_client();

  Socket listener_;
  Socket client_;
  std::uint16_t port_ = 0;
  std::unique_ptr<Controller> device_;
  std::vector<std::byte> unsent_;
  std::size_t most_per_poll_ = std::numeric_limits<std::size_t>::max();
};

}  // namespace abbe::sim

#pragma once
/// A TrackerDevice behind a TCP port. One client at a time; another one is told so and turned away.
/// Steppable: poll(now) never blocks and reads no clock. Not thread-safe.

#include <sys/socket.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "abbe/sim/error.hpp"
#include "abbe/sim/socket.hpp"
#include "abbe/sim/tracker_device.hpp"

namespace abbe::sim {

class TrackerServer {
 public:
  /// On 127.0.0.1; port 0: the kernel chooses. `machine` must outlive it.
  [[nodiscard]] static Result<TrackerServer> open(std::uint16_t port, const TrackerOptions& options,
                                                  const VirtualMachine& machine, HostTime now);

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const { return device_->next_due(); }
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] int listener_fd() const { return listener_.get(); }
  [[nodiscard]] int client_fd() const { return client_.get(); }  ///< -1 without a client
  [[nodiscard]] bool wants_write() const { return !unsent_.empty(); }
  [[nodiscard]] TrackerDevice& device() { return *device_; }
  [[nodiscard]] const TrackerDevice& device() const { return *device_; }

  void inject(const Fault& fault, HostTime now);

 private:
  TrackerServer(Socket listener, std::unique_ptr<TrackerDevice> device);

  void accept_clients(HostTime now);
  void turn_away(const Socket& stranger) const;
  void read(HostTime now);
  void write();
  void drop_client();

  Socket listener_;
  Socket client_;
  std::uint16_t port_ = 0;
  std::unique_ptr<TrackerDevice> device_;  ///< large, and the server is moved
  std::vector<std::byte> unsent_;
};

}  // namespace abbe::sim

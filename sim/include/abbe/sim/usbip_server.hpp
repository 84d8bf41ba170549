#pragma once
/// A counter card, simulated or recorded, as a USB device that a USB/IP server exports (bus id
/// "1-1"): for `usbip attach` from any Linux and for USB/IP clients. One client at a time. Requests
/// for scans wait until they can be filled, as on a real bus; a short one comes only when the scan
/// was stopped. Steppable: poll(now) never blocks and reads no clock. Not thread-safe.

#include <poll.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <vector>

#include "abbe/protocol/usbip/operations.hpp"
#include "abbe/protocol/usbip/urb.hpp"
#include "abbe/sim/counter_card.hpp"
#include "abbe/sim/error.hpp"
#include "abbe/sim/fault.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {

namespace usbip = protocol::usbip;

class UsbipServer {
 public:
  /// On 127.0.0.1; port 0: the kernel chooses.
  [[nodiscard]] static Result<UsbipServer> open(std::uint16_t port, const CounterCardOptions& card);
  [[nodiscard]] static Result<UsbipServer> open(std::uint16_t port,
                                                std::unique_ptr<ExportedCard> card);

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] int listener_fd() const { return listener_.get(); }  ///< -1 while unplugged
  [[nodiscard]] int client_fd() const { return client_.get(); }      ///< -1 without a client
  [[nodiscard]] bool wants_write() const { return !unsent_.empty(); }
  /// What to wait for besides the time.
  void add_poll_fds(std::vector<pollfd>& fds) const {
    add_server_fds(listener_, client_, wants_write(), fds);
  }
  /// The simulated one; must not be asked for with another.
  [[nodiscard]] CounterCard& card() { return *simulated_; }
  [[nodiscard]] std::size_t waiting_requests() const { return requests_.size(); }

  /// With a simulated card only.
  void inject(const Fault& fault, HostTime now);

  // Misbehaviour, for tests that step it.
  void mute(bool yes) { mute_ = yes; }  ///< scans stay in the card; the rest is answered
  void disconnect();
  void plug_out();  ///< the connection is lost; new ones are closed at once
  void plug_in() { plugged_ = true; }
  void send_bytes(std::span<const std::byte> bytes);  ///< whatever they are, into the stream
  void hold_output(bool yes) {
    hold_output_ = yes;
  }  ///< what is to be sent is kept, then sent at once
  /// The first `bytes` of what is kept leave now.
  void send_part(std::size_t bytes);

 private:
  struct Request {
    std::uint32_t sequence;
    std::uint32_t length;
  };

  UsbipServer(Socket listener, std::unique_ptr<ExportedCard> card);

  void accept_clients();
  void read(HostTime now);
  void understand(HostTime now);
  [[nodiscard]] bool on_operation();
  [[nodiscard]] bool on_urb(HostTime now);
  void on_submit(const usbip::Submit& submit, HostTime now);
  void on_unlink(const usbip::Unlink& unlink);
  void fill_requests(HostTime now);
  void reply(std::uint32_t sequence, usbip::UrbStatus status, std::uint32_t length,
             std::span<const std::byte> data);
  void write();
  void end_faults(HostTime now);
  [[nodiscard]] usbip::ExportedDevice exported() const;

  Socket listener_;
  Socket client_;
  std::uint16_t port_ = 0;
  std::unique_ptr<ExportedCard> card_;
  CounterCard* simulated_ = nullptr;  ///< card_, where it is one
  bool imported_ = false;
  bool closing_ = false;
  bool plugged_ = true;
  bool mute_ = false;
  bool deaf_ = false;
  bool hold_output_ = false;
  std::optional<HostTime> fault_ends_;
  std::vector<std::byte> incoming_;
  std::vector<std::byte> unsent_;
  std::deque<Request> requests_;  ///< for scans
};

}  // namespace abbe::sim

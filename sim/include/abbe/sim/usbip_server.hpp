#pragma once
/// A USB/IP server that exports a counter card, simulated or recorded, as a USB device (bus id
/// "1-1"): for `usbip attach` on any Linux and for USB/IP clients. One client at a time. A request
/// for scan data waits until it can be filled, as on a real bus; it is filled partly only after the
/// scan has stopped. Steppable: poll(now) never blocks and reads no clock. Not thread-safe.

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
  /// Listens on 127.0.0.1; port 0: the kernel chooses the port.
  [[nodiscard]] static Result<UsbipServer> open(std::uint16_t port, const CounterCardOptions& card);
  [[nodiscard]] static Result<UsbipServer> open(std::uint16_t port,
                                                std::unique_ptr<ExportedCard> card);

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// -1 while the device is unplugged
  [[nodiscard]] int listener_fd() const { return listener_.get(); }
  [[nodiscard]] int client_fd() const { return client_.get(); }  ///< -1 without a client
  [[nodiscard]] bool wants_write() const { return !unsent_.empty(); }
  /// Adds to `fds` the sockets that the caller must wait for, until next_due() at the latest.
  void add_poll_fds(std::vector<pollfd>& fds) const {
    add_server_fds(listener_, client_, wants_write(), fds);
  }
  /// The simulated card. Precondition: the exported card is simulated.
  [[nodiscard]] CounterCard& card() { return *simulated_; }

  /// No effect with a recorded card.
  void inject(const Fault& fault, HostTime now);

  // Functions with which tests inject faults.
  void mute(bool yes) { mute_ = yes; }  ///< no scan data is sent; control requests are answered
  void disconnect();
  void plug_out();  ///< the connection is lost; new ones are closed at once
  void plug_in() { plugged_ = true; }
  void send_bytes(std::span<const std::byte> bytes);  ///< sends any bytes into the stream
  /// true: output is held back; false: it is sent with the next poll().
  void hold_output(bool yes) { hold_output_ = yes; }
  /// Sends the first `bytes` of the output that is held back.
  void send_part(std::size_t bytes);

 private:
  struct Request {
    std::uint32_t sequence;
    std::uint32_t length;
  };

  UsbipServer(Socket listener, std::unique_ptr<ExportedCard> card);

  void accept_clients();
  void read(HostTime now);
  void process_incoming(HostTime now);
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
  CounterCard* simulated_ = nullptr;  ///< card_, or nullptr for a recorded card
  bool imported_ = false;
  bool closing_ = false;
  bool plugged_ = true;
  bool mute_ = false;
  bool unresponsive_ = false;
  bool hold_output_ = false;
  std::optional<HostTime> fault_ends_;
  std::vector<std::byte> incoming_;
  std::vector<std::byte> unsent_;
  std::deque<Request> requests_;  ///< for scan data
};

}  // namespace abbe::sim

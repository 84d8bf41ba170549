#pragma once
/// The simulated measuring machine's server on a listening socket of 127.0.0.1, in the test's own
/// thread, with its output under the test's control: lines are gathered, and sent when the test
/// calls send_gathered().

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <array>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/sim/ippdme_device.hpp"
#include "abbe/sim/socket.hpp"
#include "peer_socket.hpp"

namespace abbe::tests {

class IppDmePeer {
 public:
  explicit IppDmePeer(protocol::HostTime now, sim::IppDmeOptions options = {})
      : options_(std::move(options)),
        port_holder_(bound_socket(0)),
        port_(sim::port_of(port_holder_)) {
    power_on(now);
    listen();
  }

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] sim::IppDmeDevice& machine() { return *machine_; }

  /// Accepts a client, reads its commands, advances the machine and gathers its output.
  void serve(protocol::HostTime now) {
    accept_client(now);
    hear(now);
    machine_->advance(now);
    const auto bytes = machine_->take_output();
    gathered_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  void send_gathered() {
    if (!holding_) send(std::exchange(gathered_, {}));
  }
  /// true: the machine's output is discarded.
  void hold_answers(bool hold) {
    holding_ = hold;
    gathered_.clear();
  }
  void send(std::string_view text) {
    if (client_ && !text.empty()) ::send(client_.get(), text.data(), text.size(), MSG_NOSIGNAL);
  }

  void hang_up() {
    client_.close();
    gathered_.clear();
    machine_->disconnected();
  }
  /// As a machine without power: later data are refused.
  void reset_connection() {
    const linger at_once{.l_onoff = 1, .l_linger = 0};
    ::setsockopt(client_.get(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    hang_up();
  }
  void unplug() {
    hang_up();
    listener_.close();
  }
  void listen() {
    listener_ = bound_socket(port_);
    ASSERT_EQ(::listen(listener_.get(), 4), 0);
  }
  void restart(protocol::HostTime now) {
    hang_up();
    power_on(now);
  }

 private:
  void power_on(protocol::HostTime now) {
    machine_ = std::make_unique<sim::IppDmeDevice>(options_, now);
  }
  void accept_client(protocol::HostTime now) {
    sim::Socket accepted(
        ::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!accepted) return;
    if (client_) hang_up();
    client_ = std::move(accepted);
    const int yes = 1;
    ::setsockopt(client_.get(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    machine_->connected(now);
  }
  void hear(protocol::HostTime now) {
    if (!client_) return;
    std::array<std::byte, 4096> bytes{};
    const ssize_t n = ::recv(client_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (n > 0) machine_->receive(std::span{bytes}.first(static_cast<std::size_t>(n)), now);
    if (n == 0) hang_up();
  }

  sim::IppDmeOptions options_;
  sim::Socket port_holder_;
  std::uint16_t port_;
  sim::Socket listener_;
  sim::Socket client_;
  std::unique_ptr<sim::IppDmeDevice> machine_;
  std::string gathered_;
  bool holding_ = false;
};

}  // namespace abbe::tests

#pragma once
/// The simulated tracker controller on a listening socket of 127.0.0.1, in the test's own thread,
/// with its point packets under the test's control: they are gathered, and sent, held back or torn
/// on request; answers and events go out at once. Nothing happens but in the functions a test
/// calls.

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <array>
#include <cstring>
#include <deque>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/protocol/emscon/framer.hpp"
#include "abbe/sim/socket.hpp"
#include "abbe/sim/tracker_device.hpp"
#include "peer_socket.hpp"
#include "tracker_script.hpp"

namespace abbe::tests::tracker {

using protocol::HostTime;

inline sim::VirtualMachine standing_machine() {
  sim::PathPlan plan;
  plan.vertices = {{{0.1, 0.2, -0.3}}};
  return {sim::TruthMachine{}, sim::PathMotion::plan(plan).value()};
}

class TrackerPeer {
 public:
  explicit TrackerPeer(HostTime now, const sim::TrackerOptions& options = {})
      : options_(options),
        machine_(standing_machine()),
        port_holder_(bound_socket(0)),
        port_(sim::port_of(port_holder_)) {
    power_on(now);
    listen();
  }

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] bool connected() const { return static_cast<bool>(client_); }
  [[nodiscard]] sim::TrackerDevice& controller() { return *controller_; }
  [[nodiscard]] std::size_t packets_ready() const { return points_.size(); }

  /// Accepts a client, reads its requests, executes what is due, answers. Points are collected.
  void serve(HostTime now) {
    accept_client(now);
    hear(now);
    controller_->advance(now);
    gather();
  }

  /// Sends all points gathered so far.
  void send_points() {
    for (; !points_.empty(); points_.pop_front()) say(points_.front());
  }
  void forget_all_but_the_latest() {
    while (points_.size() > 1) points_.pop_front();
  }
  /// The first half of the latest packet; finish_torn() sends the rest.
  void send_torn() {
    forget_all_but_the_latest();
    ASSERT_FALSE(points_.empty());
    torn_ = std::move(points_.front());
    points_.clear();
    send(std::span{torn_}.first(torn_.size() / 2));
  }
  void finish_torn() {
    send(std::span{torn_}.subspan(torn_.size() / 2));
    remember(torn_);
  }
  void send(std::span<const std::byte> bytes) {
    if (client_) ::send(client_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }
  void send(std::string_view text) { send(std::as_bytes(std::span{text})); }

  /// `count` points at once, a microsecond apart, right after the last ones.
  void flood(std::size_t count) {
    std::vector<emscon::MultiPoint> points;
    for (std::size_t k = 0; k < count; ++k)
      points.push_back(point(last_said_ += std::chrono::microseconds{1}));
    send(burst(points));
  }

  /// From now on the controller's clock shows so much more.
  void jump_clock(std::chrono::seconds by) {
    clock_ahead_ += static_cast<std::int32_t>(by.count());
  }

  void hang_up() {
    client_.close();
    points_.clear();
    controller_->disconnected();
  }
  void unplug() {
    hang_up();
    listener_.close();
  }
  void listen() {
    listener_ = bound_socket(port_);
    ASSERT_EQ(::listen(listener_.get(), 4), 0);
  }
  /// Off and on again: the connection is lost, the controller's clock restarts.
  void restart(HostTime now) {
    hang_up();
    power_on(now);
  }

 private:
  void power_on(HostTime now) {
    controller_ = std::make_unique<sim::TrackerDevice>(options_, machine_, now);
  }

  void accept_client(HostTime now) {
    sim::Socket accepted(
        ::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!accepted) return;
    if (client_) hang_up();
    client_ = std::move(accepted);
    const int yes =
        // else an event after an answer waits for a delayed ACK, in a time the test does not have
        1;
    ::setsockopt(client_.get(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    controller_->connected(now);
  }

  void hear(HostTime now) {
    if (!client_) return;
    std::array<std::byte, 4096> bytes{};
    const ssize_t n = ::recv(client_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (n > 0) controller_->receive(std::span{bytes}.first(static_cast<std::size_t>(n)), now);
    if (n == 0) hang_up();
  }

  void gather() {
    const auto bytes = controller_->take_output();
    framer_->push(bytes);
    while (const auto packet = framer_->next()) {
      if (emscon::MultiResult::from(*packet)) {
        points_.emplace_back(packet->begin(), packet->end());
      } else {
        send(*packet);
      }
    }
  }

  void say(Bytes packet) {
    set_clock_ahead(packet);
    send(packet);
    remember(packet);
  }
  /// [emScon TPI 3.6] MultiMeasResultT: points of 36 bytes from byte 48 on, seconds in their bytes
  /// 4 to 7.
  void set_clock_ahead(Bytes& packet) const {
    for (std::size_t at = 48 + 4; clock_ahead_ != 0 && at + 4 <= packet.size(); at += 36) {
      std::int32_t seconds = 0;
      std::memcpy(&seconds, packet.data() + at, sizeof seconds);
      seconds += clock_ahead_;
      std::memcpy(packet.data() + at, &seconds, sizeof seconds);
    }
  }
  void remember(const Bytes& packet) {
    const auto result = emscon::MultiResult::from(packet);
    last_said_ = result->point(result->size() - 1).time.to_device_time();
  }

  sim::TrackerOptions options_;
  sim::VirtualMachine machine_;
  sim::Socket port_holder_;
  std::uint16_t port_;
  sim::Socket listener_;
  sim::Socket client_;
  std::unique_ptr<sim::TrackerDevice> controller_;
  std::unique_ptr<emscon::PacketFramer> framer_ = std::make_unique<emscon::PacketFramer>();
  std::deque<Bytes> points_;  ///< one burst each, not yet sent
  Bytes torn_;
  protocol::DeviceTime last_said_{};
  std::int32_t clock_ahead_ = 0;  ///< s
};

}  // namespace abbe::tests::tracker

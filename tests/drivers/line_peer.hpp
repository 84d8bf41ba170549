#pragma once
/// A program that prints tracker points or positions of axes as lines, on a socket of 127.0.0.1 or
/// a pseudo terminal, in the test's own thread. Nothing happens but in the functions a test calls.

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <string>
#include <string_view>
#include <variant>

#include "abbe/drivers/lines/device.hpp"
#include "abbe/sim/pseudo_terminal.hpp"
#include "abbe/sim/socket.hpp"
#include "peer_socket.hpp"

namespace abbe::tests::line_sender {

using protocol::HostTime;

inline drivers::lines::LineFormat time_x_y_z_status() {
  using enum drivers::lines::Column;
  drivers::lines::LineFormat format;
  format.columns = {Time, X, Y, Z, Status};
  format.column_count = 5;
  format.valid_status[0] = drivers::lines::StatusWord::from("0").value();
  format.valid_status_count = 1;
  return format;
}

/// The same columns with the positions of three axes, in mm.
inline drivers::lines::ValueFormat time_axes_status() {
  using drivers::lines::ColumnUse;
  drivers::lines::ValueFormat format;
  format.names = {"time", "X", "Y", "Z", "status"};
  format.column_count = 5;
  format.columns[0].use = ColumnUse::Time;
  for (std::uint8_t i = 0; i < 3; ++i)
    format.columns[1u + i] = {
        .use = ColumnUse::Value, .value = i, .scale = 1e-3, .offset = 0.0, .limit = 100.0};
  format.columns[4].use = ColumnUse::Status;
  format.value_count = 3;
  format.valid_status[0] = drivers::lines::StatusWord::from("0").value();
  format.valid_status_count = 1;
  return format;
}

/// The lines of points 2 ms apart, on a clock of their own.
class PrintedPoints {
 public:
  static constexpr std::chrono::nanoseconds kSeparation = std::chrono::milliseconds{2};

  explicit PrintedPoints(HostTime power_on) : power_on_(power_on), last_(power_on) {}

  /// The points up to `now`; `most`: the latest of them.
  std::string until(HostTime now) {
    std::string text;
    while (last_ + kSeparation <= now) text += next();
    return text;
  }
  std::string next(std::chrono::nanoseconds after = kSeparation) {
    last_ += after;
    const auto shown = last_ - power_on_ + ahead_;
    return fmt::format("{:.9f} 1523.{:04} -310.55 88.12 0\n",
                       std::chrono::duration<double>(shown).count(), number_++ % 10'000);
  }
  void skip_to(HostTime now) { last_ = std::max(last_, now - kSeparation); }
  void jump(std::chrono::nanoseconds by) { ahead_ += by; }
  void power_on(HostTime now) {
    power_on_ = last_ = now;
    ahead_ = {};
  }

 private:
  HostTime power_on_;
  HostTime last_;
  std::chrono::nanoseconds ahead_{};
  std::uint64_t number_ = 0;
};

/// How the lines get to the device. The port of a TCP server or a datagram socket of the device is
/// known only after its first wait().
class SenderWire {
 public:
  enum class Kind { Tcp, TcpServer, Udp, Serial };

  explicit SenderWire(Kind kind) : kind_(kind) {
    if (kind == Kind::Serial)
      path_ = fmt::format("{}abbe_lines_{}_{}", testing::TempDir(), ::getpid(), ++count_);
    else
      port_holder_ = bound_socket(0);
    if (kind == Kind::Udp || kind == Kind::TcpServer) {
      port_ = sim::port_of(port_holder_);
      port_holder_.close();  // the device binds it
    } else if (kind == Kind::Tcp) {
      port_ = sim::port_of(port_holder_);
    }
    plug_in();
  }

  [[nodiscard]] drivers::LineAddress address() const {
    switch (kind_) {
      case Kind::Tcp:
        return drivers::LineTcp{"127.0.0.1", port_};
      case Kind::TcpServer:
        return drivers::LineTcpServer{"127.0.0.1", port_};
      case Kind::Udp:
        return drivers::LineUdp{"127.0.0.1", port_};
      case Kind::Serial:
        break;
    }
    return drivers::LineSerial{.path = path_};
  }

  /// Connects, or accepts a connection.
  void serve() {
    if (kind_ == Kind::Tcp && listener_) {
      sim::Socket accepted(
          ::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
      if (accepted) peer_ = std::move(accepted);
    }
    if (kind_ == Kind::TcpServer && plugged_ && (!peer_ || hung_up())) connect(SOCK_STREAM);
    if (kind_ == Kind::Udp && plugged_ && !peer_) connect(SOCK_DGRAM);
  }
  [[nodiscard]] bool connected() const {
    return kind_ == Kind::Serial ? terminal_.fd() >= 0 : static_cast<bool>(peer_);
  }
  /// A datagram has whole lines.
  void send(std::string_view text) {
    constexpr std::size_t kDatagram = 1400;
    while (connected() && !text.empty()) {
      auto part = text;
      if (kind_ == Kind::Udp && text.size() > kDatagram)
        part = text.substr(0, text.rfind('\n', kDatagram) + 1);
      if (kind_ == Kind::Serial) {
        if (::write(terminal_.fd(), part.data(), part.size()) < 0) return;
      } else {
        ::send(peer_.get(), part.data(), part.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      }
      text.remove_prefix(part.size());
    }
  }
  void hang_up() {
    if (kind_ != Kind::Serial) return peer_.close();
    terminal_.close();
    plug_in();
  }
  void unplug() {
    plugged_ = false;
    peer_.close();
    listener_.close();
    terminal_.close();
  }
  void plug_in() {
    plugged_ = true;
    if (kind_ == Kind::Serial) {
      auto opened = sim::PseudoTerminal::open(path_);
      ASSERT_TRUE(opened);
      terminal_ = std::move(*opened);
    }
    if (kind_ != Kind::Tcp) return;
    listener_ = bound_socket(port_);
    ASSERT_EQ(::listen(listener_.get(), 4), 0);
  }

 private:
  [[nodiscard]] bool hung_up() const {
    std::array<char, 1> byte{};
    return ::recv(peer_.get(), byte.data(), byte.size(), MSG_DONTWAIT) == 0;
  }
  void connect(int type) {
    peer_ = sim::Socket(::socket(AF_INET, type | SOCK_CLOEXEC, 0));
    const auto at = sim::loopback_address(port_);
    if (::connect(peer_.get(), reinterpret_cast<const sockaddr*>(&at), sizeof(sockaddr_in)) != 0)
      peer_.close();
  }

  inline static int count_ = 0;
  Kind kind_;
  sim::Socket port_holder_;
  std::uint16_t port_ = 0;
  std::string path_;
  bool plugged_ = false;
  sim::Socket listener_;
  sim::Socket peer_;
  sim::PseudoTerminal terminal_;
};

}  // namespace abbe::tests::line_sender

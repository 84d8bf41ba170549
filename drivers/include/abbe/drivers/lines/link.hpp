#pragma once
/// The connection over which lines of text come: TCP to a sender, TCP from a sender, UDP datagrams
/// or a serial line. Only wait() blocks. abbe never sends. One thread; not real-time. Error texts
/// do not contain the name of the device; the driver adds it.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <variant>

#include "abbe/drivers/error.hpp"
#include "abbe/drivers/host_addresses.hpp"
#include "abbe/drivers/serial_line.hpp"
#include "abbe/drivers/tcp_client.hpp"

namespace abbe::drivers {

/// abbe connects to the sender.
struct LineTcp {
  std::string host;
  std::uint16_t port = 0;
};
/// The sender connects to abbe, one at a time. `host`: the address of this computer to listen on;
/// 0.0.0.0 or :: are all of them. Port 0: the kernel chooses it (tests).
struct LineTcpServer {
  std::string host;
  std::uint16_t port = 0;
};
/// The sender sends datagrams to abbe, each with whole lines. `host` and `port` as in
/// LineTcpServer.
struct LineUdp {
  std::string host;
  std::uint16_t port = 0;
};
struct LineSerial {
  std::string path;
  int baud = 115200;
  Parity parity = Parity::None;
  int stop_bits = 1;
};
using LineAddress = std::variant<LineTcp, LineTcpServer, LineUdp, LineSerial>;

/// "10.0.0.7:7001", "0.0.0.0:7001 (TCP server)", "0.0.0.0:7001 (UDP)", "/dev/ttyUSB0 115200 8N1".
[[nodiscard]] std::string text_of(const LineAddress& address);
/// Error BadConfiguration: host, port or path is missing, or a baud rate that the operating system
/// does not know.
[[nodiscard]] Result<void> check(const LineAddress& address);

class LineLink {
 public:
  explicit LineLink(LineAddress address);
  LineLink(const LineLink&) = delete;
  LineLink& operator=(const LineLink&) = delete;
  ~LineLink();

  /// True: each read is a datagram, whose end ends a line.
  [[nodiscard]] bool datagrams() const noexcept {
    return std::holds_alternative<LineUdp>(address_);
  }
  /// True: the first bytes may be the rest of a line.
  [[nodiscard]] bool begins_anywhere() const noexcept {
    return std::holds_alternative<LineSerial>(address_);
  }
  /// True: a connection without data may be dead, and a new one can tell.
  [[nodiscard]] bool connection_oriented() const noexcept {
    return std::holds_alternative<LineTcp>(address_) ||
           std::holds_alternative<LineTcpServer>(address_);
  }
  /// True: wait() waits until a sender connects; there is no limit of time for that.
  [[nodiscard]] bool awaits_sender() const noexcept {
    return std::holds_alternative<LineTcpServer>(address_);
  }

  /// Begins to connect, to listen or to receive; wait() returns Established when bytes can come.
  [[nodiscard]] Result<void> open();
  /// Closes the connection. A TCP server goes on listening: wait() then accepts the next sender.
  void close() noexcept;
  /// Neither connected, nor on the way to it.
  [[nodiscard]] bool closed() const noexcept;
  [[nodiscard]] bool established() const noexcept;
  /// Of a listening or receiving socket; 0: none.
  [[nodiscard]] std::uint16_t local_port() const noexcept;

  using Ready = TcpClient::Ready;
  /// Waits for at most `wall` of the operating system's time, also when closed.
  [[nodiscard]] Result<Ready> wait(std::chrono::nanoseconds wall);

  struct Read {
    std::size_t bytes = 0;   ///< 0: none yet
    bool truncated = false;  ///< the datagram was larger than the buffer
  };
  /// Error Unreachable: the peer closed, the adapter was unplugged.
  [[nodiscard]] Result<Read> read(std::span<std::byte> into);
  /// Number of senders that were turned away since construction, because one was connected.
  [[nodiscard]] std::uint64_t turned_away() const noexcept { return turned_away_; }

 private:
  [[nodiscard]] Result<void> bind_socket(const std::string& host, std::uint16_t port, int type);
  [[nodiscard]] Result<void> open_serial(const LineSerial& line);
  [[nodiscard]] bool accept_sender();
  [[nodiscard]] Result<Ready> wait_for_bytes(std::chrono::nanoseconds wall);

  LineAddress address_;
  TcpClient tcp_;          ///< LineTcp
  int listener_ = -1;      ///< LineTcpServer
  int fd_ = -1;            ///< accepted connection, receiving socket or serial line
  bool announced_ = true;  ///< wait() has returned Established for fd_
  SerialLock lock_;
  std::uint64_t turned_away_ = 0;
};

}  // namespace abbe::drivers

#pragma once
/// A TCP connection that blocks only in wait(). One thread opens, reads and writes it; not
/// real-time. Error texts do not contain the peer's name; the driver adds
/// it. TCP_NODELAY is set: commands are small and must be sent at once.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "abbe/drivers/error.hpp"
#include "abbe/drivers/host_addresses.hpp"

namespace abbe::drivers {

class TcpClient {
 public:
  TcpClient() = default;
  TcpClient(const TcpClient&) = delete;
  TcpClient& operator=(const TcpClient&) = delete;
  ~TcpClient() { close(); }

  /// Names the peer and waits at most 1 s for its address: see HostAddresses. Call it once, before
  /// the thread of the device starts.
  void look_up(const std::string& host, std::uint16_t port);
  /// Begins to connect; wait() returns Established when the connection exists. Does not wait for a
  /// name service. If the name has several addresses, each call tries the next one. Error
  /// Unreachable or SystemRefused.
  [[nodiscard]] Result<void> open();
  void close() noexcept;

  [[nodiscard]] bool closed() const noexcept { return fd_ < 0; }
  [[nodiscard]] bool established() const noexcept { return fd_ >= 0 && !opening_; }
  /// -1: closed. For EmergencyStop.
  [[nodiscard]] int descriptor() const noexcept { return fd_; }

  enum class Ready { Nothing, Established, Readable };
  /// Waits for at most `wall` of the operating system's time, also when closed. Sends bytes that
  /// write() could not send. Error Unreachable: refused, no route, reset.
  [[nodiscard]] Result<Ready> wait(std::chrono::nanoseconds wall);

  /// Returns the number of bytes read, 0 if there are none yet. Error Unreachable: closed by the
  /// peer, or reset.
  [[nodiscard]] Result<std::size_t> read(std::span<std::byte> into);
  /// Bytes that do not fit into the socket's buffer now are sent by later calls of wait().
  [[nodiscard]] Result<void> write(std::span<const std::byte> bytes);
  /// Ends the connection in an orderly way: shuts down writing and discards incoming bytes. Call
  /// close() afterwards.
  void finish() noexcept;

 private:
  [[nodiscard]] Result<void> flush();
  [[nodiscard]] Result<Ready> end_of_opening();

  int fd_ = -1;
  bool opening_ = false;
  std::unique_ptr<HostAddresses> host_;
  std::vector<std::byte> unsent_;
};

}  // namespace abbe::drivers

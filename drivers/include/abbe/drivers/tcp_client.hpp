#pragma once
/// A TCP connection that never blocks but in wait(): opened, read and written by one thread, in the
/// ordinary world. Errors are sentences without the peer's name; the driver knows it. TCP_NODELAY:
/// commands are small and due at once.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "abbe/drivers/error.hpp"

namespace abbe::drivers {

class TcpClient {
 public:
  TcpClient() = default;
  TcpClient(const TcpClient&) = delete;
  TcpClient& operator=(const TcpClient&) = delete;
  ~TcpClient() { close(); }

  /// Begins to connect; wait() says when it is done. A name is resolved here and may take its time;
  /// of several addresses the next call tries the next. Unreachable, SystemRefused.
  [[nodiscard]] Result<void> open(const std::string& host, std::uint16_t port);
  void close() noexcept;

  [[nodiscard]] bool closed() const noexcept { return fd_ < 0; }
  [[nodiscard]] bool established() const noexcept { return fd_ >= 0 && !opening_; }

  enum class Ready { Nothing, Established, Readable };
  /// Waits for at most `wall` of the operating system's time, also when closed; sends on what is
  /// still unsent. Unreachable: refused, no route, reset.
  [[nodiscard]] Result<Ready> wait(std::chrono::nanoseconds wall);

  /// Bytes read, 0 if there are none yet. Unreachable: closed by the peer, reset.
  [[nodiscard]] Result<std::size_t> read(std::span<std::byte> into);
  /// What does not fit into the socket now follows in wait().
  [[nodiscard]] Result<void> write(std::span<const std::byte> bytes);
  /// Says goodbye: no more writing; what the peer still says is thrown away. Then close().
  void finish() noexcept;

 private:
  [[nodiscard]] Result<void> flush();
  [[nodiscard]] Result<Ready> end_of_opening();

  int fd_ = -1;
  bool opening_ = false;
  unsigned tries_ = 0;
  std::vector<std::byte> unsent_;
};

}  // namespace abbe::drivers

#pragma once

#include <openssl/ssl.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "http.hpp"

namespace abbe::web {

struct ConnectionLimits {
  std::size_t request_bytes;  ///< of one request: its lines and its body
  std::chrono::milliseconds request_time, write_time;
};

/// One connection of a browser, with or without TLS. Reads at most the bytes and the time of one
/// request; httplib itself has no limit of the lines of a request nor of a chunked body. One thread.
class ConnectionStream final : public httplib::Stream {
 public:
  using Clock = std::chrono::steady_clock;
  enum class Fault { None, TooLarge, TooSlow };

  /// Does not close `fd`, which becomes non-blocking. `tls`: null without TLS. `stopping`: ends all
  /// waiting.
  ConnectionStream(int fd, SSL_CTX* tls, ConnectionLimits limits, std::function<bool()> stopping);
  ConnectionStream(const ConnectionStream&) = delete;
  ConnectionStream& operator=(const ConnectionStream&) = delete;
  ~ConnectionStream() override;

  /// The handshake of TLS; false if it fails or is too slow.
  [[nodiscard]] bool accept();
  /// False if no request begins within `time_out`.
  [[nodiscard]] bool wait_for_request(std::chrono::milliseconds time_out);
  /// From now on the limits count for another request.
  void begin_request();
  [[nodiscard]] Fault fault() const noexcept { return fault_; }

  [[nodiscard]] bool is_readable() const override;
  [[nodiscard]] bool is_writable() const override;
  ssize_t read(char* to, std::size_t size) override;
  ssize_t write(const char* from, std::size_t size) override;
  void get_remote_ip_and_port(std::string& address, int& port) const override;
  void get_local_ip_and_port(std::string& address, int& port) const override;
  [[nodiscard]] socket_t socket() const override { return fd_; }

 private:
  struct FreeTls {
    void operator()(SSL* tls) const { SSL_free(tls); }
  };
  /// Waits for poll events, in short steps because of `stopping`.
  [[nodiscard]] bool wait(short events, Clock::time_point until) const;
  /// The event that TLS needs before it can go on; 0: it failed.
  [[nodiscard]] short event_for(int tls_result) const;
  [[nodiscard]] ssize_t fill_buffer();

  int fd_;
  std::unique_ptr<SSL, FreeTls> tls_;
  ConnectionLimits limits_;
  std::function<bool()> stopping_;
  std::array<char, 16384> buffer_{};
  std::size_t at_ = 0, filled_ = 0;  ///< unread: buffer_[at_] to buffer_[filled_ - 1]
  std::size_t left_ = 0;             ///< bytes of this request that may still come
  Clock::time_point request_until_{};
  Fault fault_ = Fault::None;
};

}  // namespace abbe::web

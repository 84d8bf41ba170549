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
  std::size_t body_bytes;  ///< of one request, as it is sent: chunks with their lines
  std::chrono::milliseconds request_time, write_time;
};

/// Limits of the lines of a request (its head). Each header costs some 100 bytes of memory.
inline constexpr std::size_t kMostHeadBytes = 32 * 1024, kMostHeadLines = 100;
/// The header Range under the name that a handler sees: httplib matches it with std::regex, whose
/// recursion grows with the text, and does not check the end of a range.
inline constexpr const char* kRangeHeader = "xange";
/// A client that reads slower than this on average does not get the whole answer.
inline constexpr std::size_t kSlowestReader_bytes_per_s = 4096;

/// While connections wait for a thread, a request, and the reader of an answer, get this time
/// instead of that of ConnectionLimits: silent clients of several addresses cannot keep all
/// threads.
inline constexpr std::chrono::milliseconds kCrowdedTime{2000};

/// Numeric address of the client of a connection; empty if it has left.
[[nodiscard]] std::string client_address(int fd);

/// What a connection looks at while it waits.
struct ConnectionWatch {
  std::function<bool()> stopping;  ///< ends all waiting
  std::function<bool()> crowded;   ///< connections wait for a thread
};

/// One connection of a browser, with or without TLS. Reads at most the bytes and the time of one
/// request, and waits for a slow reader for a limited time; httplib itself has no limit of the lines
/// of a request, of a chunked body, or of the time of an answer. One thread.
class ConnectionStream final : public httplib::Stream {
 public:
  using Clock = std::chrono::steady_clock;
  enum class Fault { None, LongHead, LongBody, SlowRequest, SlowReader, Crowded };

  /// Does not close `fd`, which becomes non-blocking. `tls`: null without TLS.
  ConnectionStream(int fd, SSL_CTX* tls, ConnectionLimits limits, ConnectionWatch watch);
  ConnectionStream(const ConnectionStream&) = delete;
  ConnectionStream& operator=(const ConnectionStream&) = delete;
  ~ConnectionStream() override;

  /// The handshake of TLS; false if it fails or is too slow.
  [[nodiscard]] bool accept();
  /// False if no request begins within `time_out`.
  [[nodiscard]] bool wait_for_request(std::chrono::milliseconds time_out);
  /// From now on the limits count for another request. Waits for all its lines; false if they are
  /// too long, too many or too slow, or if the client has left.
  [[nodiscard]] bool read_head();
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
  /// Waits for poll events, in short steps because of ConnectionWatch.
  [[nodiscard]] bool wait(short events, Clock::time_point until,
                          Clock::time_point until_if_crowded) const;
  [[nodiscard]] bool wait_for_client(short events) const;
  /// The event that TLS needs before it can go on; 0: it failed.
  [[nodiscard]] short event_for(int tls_result) const;
  /// At most `size` bytes from the client; 0: it has left, -1: a fault.
  [[nodiscard]] ssize_t receive(char* to, std::size_t size);
  /// Checks the lines of the head that ends at buffer_[end].
  [[nodiscard]] bool check_head(std::size_t end);
  /// Waits until the client accepts more of the answer.
  [[nodiscard]] bool wait_for_reader(short events) const;

  int fd_;
  std::unique_ptr<SSL, FreeTls> tls_;
  ConnectionLimits limits_;
  ConnectionWatch watch_;
  std::array<char, kMostHeadBytes> buffer_{};
  std::size_t at_ = 0, filled_ = 0;  ///< unread: buffer_[at_] to buffer_[filled_ - 1]
  std::size_t left_ = 0;             ///< bytes of this request that may still be read
  Clock::time_point request_since_ = Clock::now();
  std::size_t sent_ = 0;                        ///< bytes of the answer
  mutable std::chrono::nanoseconds waited_{0};  ///< for the client to read the answer
  mutable bool crowded_out_ = false;            ///< the last wait() ended early
  mutable Fault fault_ = Fault::None;           ///< is_writable() of httplib is const
};

}  // namespace abbe::web

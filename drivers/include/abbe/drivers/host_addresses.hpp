#pragma once
/// The addresses of a host name, looked up on separate threads: a name service can take many
/// seconds to answer, and a device thread that waits for it can send nothing, not even the command
/// that stops a machine. An answer is kept while a later look-up runs or fails.

#include <sys/socket.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "abbe/drivers/error.hpp"

namespace abbe::drivers {

struct HostAddress {
  sockaddr_storage at{};
  socklen_t length = 0;
};
/// The address as text: "10.0.0.7", "fe80::1%eth0".
[[nodiscard]] std::string text_of(const HostAddress& address);

using HostLookUp =
    std::function<Result<std::vector<HostAddress>>(const std::string& host, std::uint16_t port)>;
/// Calls getaddrinfo(3) for TCP; blocks. Error Unreachable: the name has no address.
[[nodiscard]] Result<std::vector<HostAddress>> look_up_host(const std::string& host,
                                                            std::uint16_t port);

struct HostAddressesOptions {
  std::chrono::milliseconds patience{1000};  ///< longest time to wait for the first answer
  /// Two look-ups of a name begin at least this long after each other.
  std::chrono::milliseconds refresh{2000};
  /// function of the look-up; its thread may outlive the HostAddresses
  HostLookUp look_up = &look_up_host;
};

class HostAddresses {
 public:
  /// Begins the first look-up and waits for its answer, at most `patience`. An address literal
  /// needs no thread.
  HostAddresses(std::string host, std::uint16_t port, HostAddressesOptions options = {});
  ~HostAddresses();  ///< does not wait for a look-up
  HostAddresses(const HostAddresses&) = delete;
  HostAddresses& operator=(const HostAddresses&) = delete;

  /// The known addresses in turn, one per call. Does not wait; begins a look-up in the background.
  /// Error Unreachable: no look-up has given an address yet.
  [[nodiscard]] Result<HostAddress> next();

 private:
  struct Shared;
  void begin_look_up();
  std::shared_ptr<Shared> shared_;  // shared with the thread of a look-up
  HostAddressesOptions options_;
  unsigned tries_ = 0;
};

}  // namespace abbe::drivers

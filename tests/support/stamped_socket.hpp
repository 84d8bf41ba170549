#pragma once
/// For tests of the kernel's receive stamps.

#include <linux/net_tstamp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

namespace abbe::test {

/// Asks for receive stamps for as long as the program runs. A worker of the kernel switches
/// stamping off some time after the last socket that asked was closed: a test that opened its own
/// in between had a stamp for its first arrival and none for the arrivals after it.
class StampedSocket {
 public:
  StampedSocket() : fd_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    const unsigned flags = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
    if (::setsockopt(fd_, SOL_SOCKET, SO_TIMESTAMPING, &flags, sizeof flags) == 0) return;
    std::perror("SO_TIMESTAMPING");
    std::abort();
  }
  StampedSocket(const StampedSocket&) = delete;
  StampedSocket& operator=(const StampedSocket&) = delete;
  ~StampedSocket() { ::close(fd_); }

 private:
  int fd_;
};
inline const StampedSocket kStampedSocket;

}  // namespace abbe::test

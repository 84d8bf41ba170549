#pragma once
/// For tests of the kernel's receive timestamps.

#include <linux/net_tstamp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

namespace abbe::test {

/// Keeps receive timestamps switched on while the program runs. The kernel switches them off in the
/// background some time after the last socket that uses them was closed: a test that opens its own
/// socket in between would get a timestamp for the first packet and none for later ones.
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

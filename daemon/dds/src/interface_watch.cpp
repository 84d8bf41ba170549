#include "abbe/dds/interface_watch.hpp"

#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <iterator>

#include "interfaces.hpp"

namespace abbe::dds {
namespace {

/// Opens a socket that receives a message for every change of a link or of an IPv4 address; -1 if
/// the system does not permit it.
int open_netlink() {
  const int fd = ::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE);
  if (fd < 0) return -1;
  sockaddr_nl address{};
  address.nl_family = AF_NETLINK;
  address.nl_groups = RTMGRP_LINK | RTMGRP_IPV4_IFADDR;
  if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0)
    return fd;  // NOLINT
  ::close(fd);
  return -1;
}

/// Reads and discards the waiting messages; true if there were any. Their content is not needed,
/// because the caller reads the state of all interfaces afterwards.
bool has_messages(int netlink) {
  constexpr int kMostReads = 64;
  std::array<std::byte, 4096> message{};
  bool any = false;
  for (int i = 0; i < kMostReads; ++i) {
    const bool received = ::recv(netlink, message.data(), message.size(), 0) >= 0;
    // ENOBUFS: the socket buffer overflowed, so there were messages
    if (!received && errno != ENOBUFS && errno != EINTR) break;
    any = true;
  }
  return any;
}

}  // namespace

InterfaceWatch::InterfaceWatch(Clock::time_point now)
    : netlink_(open_netlink()), begun_(now), known_(running_addresses()) {}

InterfaceWatch::~InterfaceWatch() {
  if (netlink_ >= 0) ::close(netlink_);
}

std::optional<std::string> InterfaceWatch::cycle(const std::vector<std::string>& allowed,
                                                 Clock::time_point now) {
  if (netlink_ < 0) return std::nullopt;
  if (has_messages(netlink_)) {
    last_change_ = now;
    if (!first_change_) first_change_ = now;
  }

  if (!first_change_ || now - begun_ < kShortestLife) return std::nullopt;
  if (now - *last_change_ < kSettles && now - *first_change_ < kLongestWait) return std::nullopt;
  first_change_.reset();

  const auto running = running_addresses();
  std::vector<InterfaceAddress> added;
  std::ranges::set_difference(running, known_, std::back_inserter(added));
  known_.insert(known_.end(), added.begin(), added.end());
  std::ranges::sort(known_);

  const auto found = std::ranges::find_if(added, [&allowed](const InterfaceAddress& one) {
    return allowed.empty() || std::ranges::find(allowed, one.address) != allowed.end();
  });
  return found == added.end() ? std::nullopt : std::optional{found->address};
}

}  // namespace abbe::dds

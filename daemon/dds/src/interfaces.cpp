#include "interfaces.hpp"

#include <arpa/inet.h>
#include <fastdds/rtps/transport/UDPTransportDescriptor.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <vector>

namespace abbe::dds {
namespace {

/// What Fast DDS 2.9 compares with a white list: IPv4 addresses, not names of interfaces.
std::vector<std::string> addresses_that_are_up() {
  std::vector<std::string> addresses;
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return addresses;
  for (const ifaddrs* i = all; i != nullptr; i = i->ifa_next) {
    if (i->ifa_addr == nullptr || i->ifa_addr->sa_family != AF_INET || (i->ifa_flags & IFF_UP) == 0) continue;
    std::array<char, INET_ADDRSTRLEN> text{};
    const auto* address = reinterpret_cast<const sockaddr_in*>(i->ifa_addr);
    if (::inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size()) != nullptr)
      addresses.emplace_back(text.data());
  }
  ::freeifaddrs(all);
  return addresses;
}

}  // namespace

daemon::Result<void> interface_of_profile_is_up(const eprosima::fastdds::dds::DomainParticipantQos& qos) {
  using Udp = eprosima::fastdds::rtps::UDPTransportDescriptor;
  std::string named;
  const auto up = addresses_that_are_up();
  for (const auto& transport : qos.transport().user_transports) {
    const auto udp = std::dynamic_pointer_cast<const Udp>(transport);
    // Of other transports, and of UDP on every interface, nothing is asked.
    if (!udp || udp->interfaceWhiteList.empty()) return {};
    for (const auto& interface : udp->interfaceWhiteList) {
      if (std::ranges::find(up, interface) != up.end()) return {};
      named += (named.empty() ? "" : ", ") + interface;
    }
  }
  if (named.empty()) return {};
  return daemon::fail(daemon::ErrorCode::Io, "no interface of the profile is up (addresses " + named +
                                                 "): bring the network up, or change interfaceWhiteList");
}

}  // namespace abbe::dds

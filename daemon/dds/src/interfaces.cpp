#include "interfaces.hpp"

#include <arpa/inet.h>
#include <fastdds/rtps/transport/UDPTransportDescriptor.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <vector>

namespace abbe::dds {

std::vector<InterfaceAddress> running_addresses() {
  constexpr unsigned kUsed = IFF_UP | IFF_RUNNING;
  std::vector<InterfaceAddress> addresses;
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return addresses;
  for (const ifaddrs* i = all; i != nullptr; i = i->ifa_next) {
    if (i->ifa_addr == nullptr || i->ifa_addr->sa_family != AF_INET ||
        (i->ifa_flags & kUsed) != kUsed)
      continue;
    std::array<char, INET_ADDRSTRLEN> text{};
    const auto* address = reinterpret_cast<const sockaddr_in*>(i->ifa_addr);
    if (::inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size()) != nullptr)
      addresses.push_back({::if_nametoindex(i->ifa_name), text.data()});
  }
  ::freeifaddrs(all);
  std::ranges::sort(addresses);

  return addresses;
}

std::vector<std::string> white_list(const eprosima::fastdds::dds::DomainParticipantQos& qos) {
  using Udp = eprosima::fastdds::rtps::UDPTransportDescriptor;
  std::vector<std::string> all;
  for (const auto& transport : qos.transport().user_transports) {
    const auto udp = std::dynamic_pointer_cast<const Udp>(transport);
    if (!udp || udp->interfaceWhiteList.empty()) return {};
    all.insert(all.end(), udp->interfaceWhiteList.begin(), udp->interfaceWhiteList.end());
  }
  return all;
}

daemon::Result<void> interface_of_profile_is_up(
    const eprosima::fastdds::dds::DomainParticipantQos& qos) {
  const auto named = white_list(qos);
  const auto up = running_addresses();
  const auto is_named = [&named](const std::string& address) {
    return std::ranges::find(named, address) != named.end();
  };
  if (named.empty() || std::ranges::any_of(up, is_named, &InterfaceAddress::address)) return {};
  return daemon::fail(
      daemon::ErrorCode::Io,
      fmt::format(
          "no interface of the profile is up (addresses {}): bring the network up, or correct "
          "interfaceWhiteList in the profile",
          fmt::join(named, ", ")));
}

}  // namespace abbe::dds

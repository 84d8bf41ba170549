#include "abbe/web/client_network.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <iterator>

namespace abbe::web {

std::string client_network(const std::string& address) {
  in6_addr in6{};
  if (::inet_pton(AF_INET6, address.c_str(), &in6) != 1) return address;
  if (IN6_IS_ADDR_V4MAPPED(&in6)) return address.substr(address.rfind(':') + 1);
  constexpr std::size_t kNetworkBytes = 8;
  std::fill(std::begin(in6.s6_addr) + kNetworkBytes, std::end(in6.s6_addr), 0);
  std::array<char, INET6_ADDRSTRLEN> text{};
  return std::string{::inet_ntop(AF_INET6, &in6, text.data(), text.size())} + "/64";
}

}  // namespace abbe::web

#pragma once
/// An IPv4 address of a network interface.

#include <compare>
#include <string>

namespace abbe::dds {

/// With the index of its interface: multicast memberships end with the interface, and one that is
/// made again with the same address has another index.
struct InterfaceAddress {
  unsigned interface = 0;
  std::string address;
  auto operator<=>(const InterfaceAddress&) const = default;
};

}  // namespace abbe::dds

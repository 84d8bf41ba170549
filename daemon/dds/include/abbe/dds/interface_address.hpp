#pragma once
/// An IPv4 address of a network interface.

#include <compare>
#include <string>

namespace abbe::dds {

/// The interface index is part of the comparison. An interface that is deleted and created again
/// with the same address has another index, and the multicast memberships of the deleted one are
/// lost.
struct InterfaceAddress {
  unsigned interface = 0;
  std::string address;
  auto operator<=>(const InterfaceAddress&) const = default;
};

}  // namespace abbe::dds

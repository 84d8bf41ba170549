#pragma once

#include <string>

namespace abbe::web {

/// What counts as one client where requests, connections and failed log-ins are limited: an IPv4
/// address, or the network of an IPv6 address with 64 bits ("2001:db8:0:1::/64"), of which one
/// computer can use all addresses. An IPv4 address in an IPv6 one ("::ffff:192.0.2.1") is itself.
/// Other text: unchanged. Pure; any thread.
[[nodiscard]] std::string client_network(const std::string& address);

}  // namespace abbe::web

#include <fmt/format.h>

#include "abbe/drivers/session_over_tcp.hpp"

namespace abbe::drivers {

TcpPeer tcp_peer(const std::string& device, const std::string& host, std::uint16_t port) {
  return {fmt::format("{} {}:{}", device, host, port), host, port};
}

Result<void> check(const TcpPeer& peer) {
  if (!peer.host.empty() && peer.port != 0) return {};
  return tl::unexpected{
      Error{ErrorCode::BadConfiguration, peer.name + ": host or port is missing"}};
}

}  // namespace abbe::drivers

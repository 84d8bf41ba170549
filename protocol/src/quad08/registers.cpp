#include "abbe/protocol/quad08/registers.hpp"

#include "abbe/protocol/bytes.hpp"

namespace abbe::protocol::quad08 {

std::optional<std::uint16_t> decode_word(std::span<const std::byte> bytes) ABBE_RT {
  if (bytes.size() != sizeof(std::uint16_t)) return std::nullopt;
  return ByteReader{bytes}.little<std::uint16_t>();
}

}  // namespace abbe::protocol::quad08
